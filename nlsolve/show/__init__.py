"""Tables, figures and the report that a study declares of its results.

It may import series, contracts, registry and results.
"""
