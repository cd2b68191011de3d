"""R(v) = 0, the balance of momentum: its first state, its increments, and what is measured on the states that solve it.

It may import series, contracts, registry, results and solving.
"""
