"""Triangles of degree 2: their nodes on a cloud, and the functions between these."""
