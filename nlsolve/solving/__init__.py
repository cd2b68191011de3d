"""One problem, one method: the loop that stops it, the kept tangent K*, and the ledger that counts and times its work.

It may import series, contracts and results.
"""
