"""Installed plugins: their entry points, the contract each was written for, and whether it can be imported."""
