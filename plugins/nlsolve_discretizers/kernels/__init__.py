"""Formulas for many targets that numba compiles where it is installed: extra nlsolve[numba]. Else numpy runs them."""

from nlsolve_discretizers.kernels import normal_equations, offsets, quadrants, ranking, rows

__all__ = ["normal_equations", "offsets", "quadrants", "ranking", "rows"]
