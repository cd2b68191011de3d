"""Seconds: what a unit of work costs here, and the exclusive lane, in which cases are timed in rounds on a core of
their own.
"""
