"""Formulas for many targets that numba compiles where it is installed: extra nlsolve[numba]. Else numpy runs them."""
