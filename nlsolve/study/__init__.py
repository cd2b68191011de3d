"""A study file becomes validated cases: sections, sweeps, and a sentence with the line for every mistake.

It may import series, contracts, registry, results, solving, algebra, flow and show.
"""
