"""What a method yields and a residual is: other things are told with the plugin's name, and idle steps are doubted."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, Literal

import numpy as np
import pytest
from nlsolve_solvers import Newton

import nlsolve
from nlsolve.plugin import NonlinearProblem, NonlinearSolver, Step
from nlsolve.solving.driver import solve
from nlsolve.solving.stopping import Budget, StoppingTest
from nlsolve.solving.tangent import Tangent
from nlsolve.solving.work.ledger import Ledger
from nlsolve.testing.toy_problem import DenseLU


class Odd(NonlinearSolver):
    """Newton's method that yields something else."""

    kind: Literal["odd"] = "odd"
    yields: str = ""

    def steps(self, problem: Any, tangent: Any, start: Any) -> Iterator[Step]:
        state = start
        while True:
            yield {  # type: ignore[misc]
                "array": state,
                "list": Step(state.tolist()),
                "column": Step(state[:, None]),
                "complex": Step(state + 0.0j),
                "integers": Step(state.astype(int)),
            }.get(self.yields, Step(state))
            tangent.refresh_if_due(lambda: problem.jacobian(state))
            state = state - tangent.solve(problem.residual(state))


def square(u: Any) -> Any:
    return u**2 - 2.0


@pytest.mark.parametrize(
    ("yields", "sentence"),
    [
        ("array", "the solver 'odd' yielded a ndarray, not a Step: yield Step(state)"),
        ("list", "the solver 'odd' yielded a state that is a list, not an array of shape (1,)"),
        ("column", "the solver 'odd' yielded a state of shape (1, 1), not of the shape (1,) of its start"),
        ("complex", "the solver 'odd' yielded a state of complex128 numbers: states are real, float64; convert it"),
        ("integers", "the solver 'odd' yielded a state of int64 numbers: states are real, float64; convert it"),
    ],
)
def test_what_is_no_state_is_told_with_the_name_of_the_solver(yields: str, sentence: str) -> None:
    with pytest.raises(TypeError) as caught:
        nlsolve.solve(square, [1.0], Odd(yields=yields))
    assert str(caught.value) == sentence
    row = nlsolve.compare(square, [1.0], [Odd(yields=yields)]).iloc[0]
    assert row["status"] == "crashed"
    assert sentence in row["message"]


class Wide(NonlinearProblem):
    def __init__(self, residual: Any) -> None:
        self.given = residual

    def residual(self, u: Any) -> Any:
        return self.given(u)

    def scale(self, u: Any) -> float:
        return 1.0


def test_a_step_without_counted_work_is_doubted() -> None:
    study = {
        "question": "Is an idle step told?",
        "scene": {"kind": "bratu", "nodes": 2},
        "solver": Odd(),
        "sweep": [{"grid": {"solver": [Odd(), Idle()]}}],
    }
    runs = nlsolve.run(study, isolation="none").runs
    assert list(runs["status"]) == ["converged", "converged"]
    assert runs["doubt"].fillna("")[0] == ""
    assert runs["doubt"][1].startswith("the solver 'idle' took 1 of ")
    assert "steps with no counted work" in runs["doubt"][1]
    assert nlsolve.solve(square, [1.0], Idle()).idle == 1


class Idle(NonlinearSolver):
    """Newton's method that also yields a state it has not worked for."""

    kind: Literal["idle"] = "idle"

    def steps(self, problem: Any, tangent: Any, start: Any) -> Iterator[Step]:
        yield Step(start)
        state = 1.01 * start + 0.01
        while True:
            yield Step(state)
            tangent.refresh_if_due(lambda: problem.jacobian(state))
            state = state - tangent.solve(problem.residual(state))


@pytest.mark.parametrize(
    ("residual", "sentence"),
    [
        (lambda u: u**2 - 2.0 + 0.0j, "the residual of Wide is of complex128 numbers, which should be real"),
        (
            lambda u: (u**2 - 2.0)[:, None],
            "the residual of Wide is of shape (2, 1), not of the shape (2,) of its state",
        ),
    ],
)
def test_what_is_no_residual_is_told_with_the_name_of_the_problem(residual: Any, sentence: str) -> None:
    ledger = Ledger()
    tangent = Tangent(DenseLU(), None, ledger)
    with pytest.raises(TypeError) as caught:
        solve(Wide(residual), Newton(), tangent, np.array([1.0, 2.0]), StoppingTest(), Budget(), ledger)
    assert str(caught.value) == sentence
