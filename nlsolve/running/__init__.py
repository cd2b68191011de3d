"""Cases become results: they are run, kept, resumed, timed and forecast.

It may import series, contracts, registry, results, solving, algebra, flow, show and study.
"""
