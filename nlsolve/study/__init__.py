"""A study file becomes cases: its sections, what is swept, and what is wrong with it, with its line.

It may import series, contracts, registry, results, solving, algebra, flow and show.
"""
