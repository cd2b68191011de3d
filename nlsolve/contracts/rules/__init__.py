"""Contracts of rules that methods share: what K* is made of, when it is renewed, where an increment begins, step lengths."""
