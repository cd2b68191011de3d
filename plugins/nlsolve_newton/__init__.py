"""Newton's method, modified Newton, pseudo-transient continuation and Levenberg and Marquardt's method."""

from __future__ import annotations

from collections.abc import Iterable

from nlsolve import Component, hookimpl
from nlsolve_newton.levenberg_marquardt import LevenbergMarquardt
from nlsolve_newton.newton import ModifiedNewton, Newton
from nlsolve_newton.pseudo_transient import PseudoTransient

__all__ = ["LevenbergMarquardt", "ModifiedNewton", "Newton", "PseudoTransient"]


@hookimpl
def nlsolve_components() -> Iterable[type[Component]]:
    return [Newton, ModifiedNewton, PseudoTransient, LevenbergMarquardt]
