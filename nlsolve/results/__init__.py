"""What studies find: the columns of their tables, verdicts on runs, profiles, costs and the values that papers report.

It may import series, contracts and registry.
"""
