"""The command line: data on standard output, all else on standard error.

It may import registry, flow, show, study and running.
"""
