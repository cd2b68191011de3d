"""Rules shared by every method: when K* is renewed, where an increment begins, how long a step may be."""

from __future__ import annotations

from collections.abc import Iterable

from nlsolve.plugin import Component, hookimpl
from nlsolve_rules.energy import Energy
from nlsolve_rules.full_steps import FullSteps
from nlsolve_rules.least_residual import Backtracking, Cubic, NonMonotone
from nlsolve_rules.predictors import Polynomial, Previous
from nlsolve_rules.refresh import (
    AverageCost,
    CostOptimal,
    EveryIteration,
    EveryM,
    Never,
    PoorContraction,
    RangeUnderOne,
)

REFRESH_RULES = (EveryIteration, EveryM, PoorContraction, CostOptimal, AverageCost, RangeUnderOne, Never)
PREDICTORS = (Previous, Polynomial)
GLOBALIZATIONS = (FullSteps, Backtracking, Cubic, NonMonotone, Energy)


@hookimpl
def nlsolve_components() -> Iterable[type[Component]]:
    """The refresh rules, predictors and globalisations of this package."""
    return (*REFRESH_RULES, *PREDICTORS, *GLOBALIZATIONS)
