"""The contracts that plugins implement, one noun a file; those of flows are in `continuum`, those of rules in `rules`.

It may import series.
"""
