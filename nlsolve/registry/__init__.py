"""What is installed, by contract and kind, and the sentences for what a document asks of it in vain.

It may import contracts.
"""
