"""Contracts of rules that methods share: what K* is and when it is renewed, where an increment begins, step lengths."""
