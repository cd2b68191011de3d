"""v_{k+1} from v_k, v_{k−1}, … : the last velocity, and its Taylor series in time."""

from __future__ import annotations

from collections.abc import Iterable

from nlsolve import Component, hookimpl
from nlsolve_predictors.polynomial import Polynomial, Previous

__all__ = ["Polynomial", "Previous"]


@hookimpl
def nlsolve_components() -> Iterable[type[Component]]:
    return [Previous, Polynomial]
