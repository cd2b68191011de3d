"""The asymptotic numerical method: a homotopy, a series with one kept K*, and a range; one file for each choice."""

from nlsolve_solvers.homotopy.method import AsymptoticNumericalMethod

__all__ = ["AsymptoticNumericalMethod"]
