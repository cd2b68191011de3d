"""The contracts of rules that methods share: when K* is renewed, where an increment begins, how long a step may be."""
