"""Every contract ships its check: the conformance kit of nlsolve, for its own plugins and for strangers'.

    def test_my_law() -> None:
        check_law(MyLaw())

A check takes an instance, runs it through what its contract promises, and raises AssertionError with a sentence that
says which promise was broken and by how much. The numbers it draws are seeded: a check fails always or never.

It may import series, contracts, registry, solving, flow and algebra.
"""

from __future__ import annotations

from nlsolve.testing.discretizers import check_discretizer
from nlsolve.testing.kit.toys import ToyLaw, toy_cloud
from nlsolve.testing.laws import check_law
from nlsolve.testing.linear_solvers import check_linear_solver
from nlsolve.testing.problems import check_problem
from nlsolve.testing.rules import (
    check_globalization,
    check_homotopy_form,
    check_operator,
    check_predictor,
    check_range_rule,
    check_refresh_rule,
)
from nlsolve.testing.scenes import check_scene, check_simulation, check_system
from nlsolve.testing.solvers import check_solver

__all__ = [
    "ToyLaw",
    "check_discretizer",
    "check_globalization",
    "check_homotopy_form",
    "check_law",
    "check_linear_solver",
    "check_operator",
    "check_predictor",
    "check_problem",
    "check_range_rule",
    "check_refresh_rule",
    "check_scene",
    "check_simulation",
    "check_solver",
    "check_system",
    "toy_cloud",
]
