"""Weights of derivatives at points from values at their neighbours, and the sparse operators made of them."""
