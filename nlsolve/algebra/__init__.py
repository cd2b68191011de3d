"""F(u) = 0 given as one formula: its Jacobian by groups of columns, one solve, and whether a root is where it ended.

It may import series and contracts.
"""
