"""R(v) = 0, the balance of momentum: from the first state on, increment after increment, to what is measured on it.

It may import series, contracts, registry, results and solving.
"""
