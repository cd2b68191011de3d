"""F(u) = 0 given as one formula: its Jacobian by groups of columns, and the check that its solve has ended at a root.

It may import series and contracts.
"""
