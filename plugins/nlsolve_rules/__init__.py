"""Rules shared by every method: what K* is made of, when it is renewed, where an increment begins, step lengths."""

from __future__ import annotations

from collections.abc import Iterable

from nlsolve.plugin import Component, hookimpl
from nlsolve_rules.energy import Energy
from nlsolve_rules.full_steps import FullSteps
from nlsolve_rules.goldstein import Goldstein
from nlsolve_rules.least_residual import Backtracking, Cubic, NonMonotone
from nlsolve_rules.operators import (
    Diagonal,
    FirstTangent,
    Mass,
    Newtonian,
    OtherDiscretization,
    PreviousTangent,
    Secant,
    TangentHere,
)
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
OPERATORS = (
    TangentHere,
    PreviousTangent,
    FirstTangent,
    Secant,
    Newtonian,
    OtherDiscretization,
    Diagonal,
    Mass,
)
PREDICTORS = (Previous, Polynomial)
GLOBALIZATIONS = (FullSteps, Backtracking, Cubic, Goldstein, NonMonotone, Energy)


@hookimpl
def nlsolve_components() -> Iterable[type[Component]]:
    """The refresh rules, iteration operators, predictors and globalisations of this package."""
    return (*REFRESH_RULES, *OPERATORS, *PREDICTORS, *GLOBALIZATIONS)
