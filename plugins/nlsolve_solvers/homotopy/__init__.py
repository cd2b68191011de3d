"""The asymptotic numerical method: a homotopy, a series with one kept K*, and a range; one file for each choice."""

from nlsolve_solvers.homotopy.forms import FORMS
from nlsolve_solvers.homotopy.method import AsymptoticNumericalMethod
from nlsolve_solvers.homotopy.ranges import RANGE_RULES

__all__ = ["FORMS", "RANGE_RULES", "AsymptoticNumericalMethod"]
