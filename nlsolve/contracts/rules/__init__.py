"""The contracts of rules that methods share: what K* is made of, when it is renewed, where an increment begins, how
long a step may be; and of the rules of a series: which path it follows, and how far along that path it is used.
"""
