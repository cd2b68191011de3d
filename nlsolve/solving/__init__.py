"""One method on one problem: the loop that takes and stops its steps, the tangent K*, and the ledger of its work.

It may import series, contracts, algebra and results.
"""
