"""The installed component classes by contract and kind, and sentences for the mistakes in a study, with file and line.

It may import contracts.
"""
