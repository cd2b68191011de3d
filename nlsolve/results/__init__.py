"""Result frames and what is concluded from them: columns, selection, verdicts, profiles, costs, published values.

It may import series, contracts and registry.
"""
