"""Roots at or near zero, roots of high multiplicity, starts at a root: no false doubt, and no right one lost."""

from __future__ import annotations

from typing import Any, Literal

import numpy as np
import pandas as pd
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import nlsolve
from nlsolve.plugin import System

METHODS = ("robust", "newton", "modified-newton", "trust-region", "levenberg-marquardt", "broyden", "anderson", "anm")


class Deviation(System):
    """sinh x + y/2 = 0, y + x y = 0 around (s, s), where J = [[1, 1/2], [0, 1]]."""

    kind: Literal["deviation"] = "deviation"
    shift: float = 0.0
    begin: float = 1.0

    def formula(self, u: Any) -> Any:
        x, y = u - self.shift
        return np.stack([np.sinh(x) + 0.5 * y, y + x * y])

    def standard_start(self) -> np.ndarray:
        return np.full(2, self.begin + self.shift)


class Multiple(System):
    """s (x − r)^m = 0."""

    kind: Literal["multiple"] = "multiple"
    power: int = 3
    root: float = 0.0
    size: float = 1.0
    begin: float = 1.0
    listed: bool = False

    def formula(self, u: Any) -> Any:
        return self.size * (u - self.root) ** self.power

    def standard_start(self) -> np.ndarray:
        return np.array([self.begin])

    def roots(self) -> np.ndarray | None:
        return np.array([[self.root]]) if self.listed else None


class Rootless(System):
    """Small without a zero: exp(−x), exp(−x²), 1/(1 + x²)²."""

    kind: Literal["rootless"] = "rootless"
    shape: Literal["exp", "gauss", "power"] = "exp"
    begin: float = 1.0

    def formula(self, u: Any) -> Any:
        if self.shape == "power":
            return (1.0 + u * u) ** -2
        return np.exp(-u if self.shape == "exp" else -u * u)

    def standard_start(self) -> np.ndarray:
        return np.array([self.begin])


def row(scene: System, solver: str, **sections: Any) -> pd.Series:
    return nlsolve.run({"question": "?", "scene": scene, "solver": {"kind": solver}, **sections}).runs.iloc[0]


@pytest.mark.parametrize("solver", METHODS)
@pytest.mark.parametrize("shift", [0.0, 1.0])
def test_a_regular_root_at_the_origin_is_not_doubted(solver: str, shift: float) -> None:
    run = row(Deviation(shift=shift), solver)
    assert (run["status"], run["doubt"]) == ("converged", "")


@pytest.mark.parametrize("tolerance", [1e-8, 1e-20, 1e-100])
@pytest.mark.parametrize("solver", ["broyden", "modified-newton"])
def test_nor_under_any_tolerance(solver: str, tolerance: float) -> None:
    run = row(Deviation(), solver, stop={"kind": "residual", "tolerance": tolerance})
    assert (run["status"], run["doubt"]) == ("converged", "")


@pytest.mark.parametrize("begin", [0.0, 1e-300, 1e-12, 1e-9])
def test_nor_from_starts_at_it_or_near_it(begin: float) -> None:
    """What is small beside 1 need not be small beside the start, which alone tells the unit of the unknowns."""
    run = row(Deviation(begin=begin), "newton")
    assert (run["status"], run["doubt"]) == ("converged", "")
    assert run["iterations"] <= (0 if begin < 1e-292 else 2)
    absolute = row(Deviation(begin=begin), "newton", stop={"kind": "absolute"})
    assert (absolute["status"], absolute["iterations"]) == ("converged", 0)


@pytest.mark.parametrize("begin", [2.0, -0.5, 1e-3])
@pytest.mark.parametrize(("root", "listed"), [(0.0, False), (0.0, True), (1e-9, False), (1.0, False), (1.0, True)])
@pytest.mark.parametrize("power", [1, 3, 8])
def test_a_multiple_root_is_not_doubted(power: int, root: float, begin: float, listed: bool) -> None:
    run = row(Multiple(power=power, root=root, begin=root + begin, listed=listed), "newton")
    assert (run["status"], run["doubt"]) == ("converged", "")


@pytest.mark.parametrize("solver", METHODS)
@pytest.mark.parametrize(
    "stop",
    [{"kind": "residual"}, {"kind": "difference"}, {"kind": "difference", "norm": "maximum"}, {"kind": "claim"}],
    ids=lambda stop: "-".join(stop.values()),
)
def test_a_start_at_a_multiple_root_is_solved_at_once_under_every_stopping_test(
    solver: str, stop: dict[str, Any]
) -> None:
    if stop["kind"] == "claim" and solver != "anm":
        with pytest.raises(nlsolve.StudyError, match="claim"):
            row(Multiple(begin=0.0), solver, stop=stop)
        return
    run = row(Multiple(begin=0.0), solver, stop=stop)
    assert (run["status"], run["residual_norm"], run["doubt"]) == ("converged", 0.0, "")
    assert (run["false_convergence"], run["false_failure"]) == (0, 0)
    if stop["kind"] != "residual" and "R = 0" in run["message"]:
        assert run["message"].endswith("R = 0, and the method has no further step to compare or to claim")


NOWHERE_NEAR = pytest.mark.parametrize(
    "scene",
    [
        Rootless(shape="exp"),
        Rootless(shape="exp", begin=-30.0),
        Rootless(shape="gauss", begin=1.5),
        Rootless(shape="power"),
        Multiple(power=1, root=100.0, size=1e-11, begin=0.0),
        Multiple(power=3, root=100.0, size=1e-15, begin=60.0),
        Multiple(power=3, root=100.0, size=1e-15, begin=0.0),
    ],
    ids=str,
)


@NOWHERE_NEAR
def test_a_state_that_no_root_is_near_is_doubted_when_a_bound_of_the_residual_takes_it(scene: System) -> None:
    run = row(scene, "newton", stop={"kind": "absolute"})
    assert run["status"] == "converged"
    assert run["doubt"].startswith("no root is near: ")


@NOWHERE_NEAR
def test_and_not_taken_for_solved_otherwise(scene: System) -> None:
    study = {"question": "?", "scene": scene, "solver": {"kind": "newton"}}
    run = nlsolve.run(study | {"scene": scene.model_copy(update={"listed": True})}).runs.iloc[0]
    if isinstance(scene, Rootless):
        assert run["status"] in ("stagnated", "budget spent")
    else:
        assert (run["status"], run["doubt"]) == ("converged", "")
        assert run["root_error"] < 1e-6


@settings(max_examples=10, deadline=None)
@given(power=st.integers(1, 6), size=st.floats(0.5, 2.0), begin=st.floats(0.5, 3.0))
def test_a_power_is_solved_without_a_doubt_from_anywhere(power: int, size: float, begin: float) -> None:
    run = row(Multiple(power=power, size=size, begin=begin), "robust")
    assert (run["status"], run["doubt"]) == ("converged", "")
