"""The command line: data on standard output, all else on standard error.

It may import contracts, registry, results, flow, show, study, running and testing.
"""
