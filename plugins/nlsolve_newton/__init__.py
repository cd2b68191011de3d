"""Newton's method, modified Newton, pseudo-transient, Levenberg and Marquardt's method, and a polyalgorithm of them."""

from __future__ import annotations

from collections.abc import Iterable

from nlsolve import Component, hookimpl
from nlsolve_newton.levenberg_marquardt import LevenbergMarquardt
from nlsolve_newton.newton import ModifiedNewton, Newton
from nlsolve_newton.pseudo_transient import PseudoTransient
from nlsolve_newton.robust import Robust

__all__ = ["LevenbergMarquardt", "ModifiedNewton", "Newton", "PseudoTransient", "Robust"]


@hookimpl
def nlsolve_components() -> Iterable[type[Component]]:
    return [Newton, ModifiedNewton, PseudoTransient, LevenbergMarquardt, Robust]
