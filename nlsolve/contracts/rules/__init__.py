"""The contracts of rules that methods share: when K* is renewed, where an increment begins, how long a step may be; and
of the rules of a series: which path it follows, and how far along that path it is used.
"""
