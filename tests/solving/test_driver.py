"""The driver: every ending, three stopping tests, three norms."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
import pytest
import scipy.sparse as sp
from cases import PLAIN, run
from nlsolve_rules.refresh import EveryIteration, Never
from nlsolve_solvers import Newton
from nlsolve_solvers.homotopy import AsymptoticNumericalMethod
from nlsolve_solvers.modified_newton import ModifiedNewton
from pydantic import ValidationError

from nlsolve import SolveError, Status
from nlsolve.plugin import Expansion, KeptTangent, NonlinearProblem, NonlinearSolver, Series, Step
from nlsolve.results.columns import STEPS
from nlsolve.results.frames import steps_frame
from nlsolve.solving.driver import PATIENCE
from nlsolve.solving.stopping import Budget, StoppingTest
from nlsolve.testing.toy_problem import DenseLU, ToyProblem

START = ToyProblem.solution + 0.5 * np.cos(np.arange(12.0))


class Scalar(NonlinearProblem):
    """R(u) = f(u) for one unknown."""

    def __init__(self, f: Callable[[Any], Any]) -> None:
        self.f = f

    def residual(self, u: np.ndarray) -> np.ndarray:
        return self.f(u)

    def scale(self, u: np.ndarray) -> float:
        return 1.0

    def jacobian(self, u: np.ndarray) -> Any:
        return sp.csr_array(np.atleast_2d(self.f(Series.seed(u)).coefficient(1)))

    def expand(self, u: np.ndarray) -> Expansion:
        path = Series(u)
        return Expansion(path, self.f(path))


class Walk(NonlinearSolver):
    """Yields what it is given, whatever the problem says."""

    states: tuple[float, ...]
    claims_from: int = 10**9
    ends: bool = True

    def steps(self, problem: NonlinearProblem, tangent: KeptTangent, start: np.ndarray) -> Iterator[Step]:
        yield Step(start)
        for number, state in enumerate(self.states, 1):
            yield Step(np.full_like(start, state), claim=number >= self.claims_from)
        while not self.ends:
            yield Step(np.full_like(start, self.states[-1]))


class Says(NonlinearSolver):
    """One step, and what the method says of it; then it may break down."""

    state: float
    claim: bool | None
    breaks: bool = False

    def steps(self, problem: NonlinearProblem, tangent: KeptTangent, start: np.ndarray) -> Iterator[Step]:
        yield Step(start)
        yield Step(np.full_like(start, self.state), claim=self.claim)
        if self.breaks:
            raise SolveError(Status.STAGNATED, "no further")


IDENTITY = Scalar(lambda u: 1.0 * u)
ONE = np.array([1.0])


# Endings.


def test_converged() -> None:
    outcome, _ = run(ToyProblem(), Newton(), EveryIteration(), START, DenseLU())
    assert outcome.status is Status.CONVERGED
    assert outcome.detail == Status.CONVERGED.sentence
    assert outcome.residual_norm <= 1e-10
    assert [row["step"] for row in outcome.rows] == list(range(len(outcome.rows)))
    np.testing.assert_allclose(outcome.state, ToyProblem.solution, atol=1e-10)


def test_a_start_that_is_the_solution_takes_no_step() -> None:
    outcome, ledger = run(ToyProblem(), Newton(), EveryIteration(), ToyProblem.solution.copy(), DenseLU())
    assert outcome.status is Status.CONVERGED
    assert len(outcome.rows) == 1
    assert ledger.counts["factorization"] == 0


def test_budget_spent() -> None:
    outcome, ledger = run(ToyProblem(), ModifiedNewton(), Never(), START, DenseLU(), iterations=3)
    assert outcome.status is Status.BUDGET_SPENT
    assert len(outcome.rows) == 4  # the start and three iterations
    assert ledger.counts["triangular_solve"] == 3
    assert 1e-10 < outcome.residual_norm < np.inf


def test_stagnated() -> None:
    """No new smallest residual for `PATIENCE` steps."""
    outcome, _ = run(IDENTITY, Walk(states=(0.5,), ends=False), None, ONE)
    assert outcome.status is Status.STAGNATED
    assert len(outcome.rows) == 2 + PATIENCE


def test_slow_progress_is_not_stagnation() -> None:
    states = tuple(0.99**j for j in range(1, 120))
    outcome, _ = run(IDENTITY, Walk(states=states), None, ONE, iterations=100)
    assert outcome.status is Status.BUDGET_SPENT


def test_a_method_that_stops_by_itself() -> None:
    outcome, _ = run(IDENTITY, Walk(states=(0.5,)), None, ONE)
    assert outcome.status is Status.STAGNATED
    assert "stopped by itself" in outcome.detail
    assert outcome.state[0] == 0.5


def test_diverged() -> None:
    outcome, _ = run(IDENTITY, Walk(states=(1e3, 1e7)), None, ONE)
    assert outcome.status is Status.DIVERGED
    assert len(outcome.rows) == 3


def test_full_newton_steps_diverge_where_damped_ones_converge() -> None:
    """u/√(1 + u²) from beyond 1: u ← −u³, the textbook divergence."""
    problem = Scalar(lambda u: u / np.sqrt(1.0 + u * u))
    full, _ = run(
        problem, Newton(globalization={"kind": "none"}), EveryIteration(), np.array([1.2]), DenseLU(), iterations=5
    )
    damped, _ = run(problem, Newton(), EveryIteration(), np.array([1.2]), DenseLU(), iterations=20)
    assert full.status is Status.BUDGET_SPENT
    assert abs(full.state[0]) > 1e6
    assert damped.status is Status.CONVERGED


def test_a_finite_state_without_a_finite_residual_is_out_of_the_domain() -> None:
    with np.errstate(over="ignore"):
        outcome, _ = run(Scalar(lambda u: np.exp(u)), Walk(states=(1e4,)), None, ONE)
    assert outcome.status is Status.OUT_OF_DOMAIN


def test_non_finite_state() -> None:
    class Lost(NonlinearSolver):
        def steps(self, problem: NonlinearProblem, tangent: KeptTangent, start: np.ndarray) -> Iterator[Step]:
            yield Step(start)
            yield Step(np.full_like(start, np.nan))

    outcome, _ = run(IDENTITY, Lost(), None, ONE)
    assert outcome.status is Status.NON_FINITE
    assert outcome.blame == {}


def test_non_finite_right_hand_side() -> None:
    class Blind(NonlinearSolver):
        def steps(self, problem: NonlinearProblem, tangent: KeptTangent, start: np.ndarray) -> Iterator[Step]:
            yield Step(start)
            tangent.refresh_if_due(lambda: problem.jacobian(start))
            tangent.solve(np.full_like(start, np.nan))

    outcome, _ = run(ToyProblem(), Blind(), None, START, DenseLU())
    assert outcome.status is Status.NON_FINITE
    assert "right-hand side" in outcome.detail


@pytest.mark.parametrize("solver", [Newton(), ModifiedNewton(), AsymptoticNumericalMethod()], ids=lambda s: s.kind)
def test_singular_tangent(solver: NonlinearSolver) -> None:
    """u² − 1 at u = 0."""
    outcome, _ = run(Scalar(lambda u: u * u - 1.0), solver, None, np.array([0.0]), PLAIN)
    assert outcome.status is Status.SINGULAR_TANGENT
    assert outcome.state[0] == 0.0


def test_range_exhausted() -> None:
    """u³ − 1 from 1e-3: W_1 = 1/(3 u²) is far beyond the radius of the series, which is of the size of u."""
    outcome, _ = run(
        Scalar(lambda u: u * u * u - 1.0), AsymptoticNumericalMethod(order=6), None, np.array([1e-3]), PLAIN
    )
    assert outcome.status is Status.RANGE_EXHAUSTED
    assert "a_max" in outcome.detail


def test_any_solve_error_of_a_method_becomes_its_status() -> None:
    class Lost(NonlinearSolver):
        def steps(self, problem: NonlinearProblem, tangent: KeptTangent, start: np.ndarray) -> Iterator[Step]:
            yield Step(start)
            raise SolveError(Status.BAD_CLOUD, "here")

    outcome, _ = run(IDENTITY, Lost(), None, ONE)
    assert (outcome.status, outcome.detail) == (Status.BAD_CLOUD, "here")


def test_a_programming_error_is_not_dressed_up_as_an_ending() -> None:
    class Broken(NonlinearSolver):
        def steps(self, problem: NonlinearProblem, tangent: KeptTangent, start: np.ndarray) -> Iterator[Step]:
            yield Step(start)
            tangent.solve(start)

    with pytest.raises(TypeError, match="call refresh_if_due before solve"):
        run(IDENTITY, Broken(), None, ONE)


def test_every_status_has_a_sentence_of_its_own() -> None:
    sentences = {status.sentence for status in Status}
    assert len(sentences) == len(Status)
    assert all(len(sentence.split()) > 4 for sentence in sentences)
    assert Status.NON_FINITE.word == "non finite"


# Notes.


class Noting(NonlinearSolver):
    """Halves the state, and notes more than there are columns for."""

    def steps(self, problem: NonlinearProblem, tangent: KeptTangent, start: np.ndarray) -> Iterator[Step]:
        yield Step(start)
        yield Step(0.5 * start, notes={"length": 0.5, "shift": 3.0, "why": "because", "residual_norm": 0.0, "step": 9})


def test_a_note_without_a_column_is_kept_under_its_name() -> None:
    outcome, _ = run(IDENTITY, Noting(), None, ONE)
    row = outcome.rows[1]
    assert (row["length"], row["note.shift"], row["note.why"]) == (0.5, 3.0, "because")
    frame = steps_frame(outcome.rows)
    assert list(frame.columns) == [*(name for name in STEPS if name != "case"), "note.shift", "note.why"]
    assert frame["note.shift"].tolist()[1:] == [3.0]


def test_a_note_does_not_take_the_place_of_what_the_driver_measured() -> None:
    outcome, _ = run(IDENTITY, Noting(), None, ONE)
    assert (outcome.rows[1]["step"], outcome.rows[1]["residual_norm"]) == (1, 0.5)
    assert outcome.rows[1]["residual_absolute"] == 0.5


# Stopping tests.


def test_stopping_by_residual_is_relative_to_the_scale_of_the_problem() -> None:
    class Scaled(Scalar):
        def scale(self, u: np.ndarray) -> float:
            return 100.0

    walk = Walk(states=(0.5, 0.05, 0.005))
    outcome, _ = run(Scaled(lambda u: 1.0 * u), walk, None, ONE, stop=StoppingTest(tolerance=1e-3))
    assert outcome.state[0] == 0.05
    assert outcome.residual_norm == pytest.approx(5e-4)


def test_the_residual_is_told_in_its_own_unit_too() -> None:
    class Scaled(Scalar):
        def scale(self, u: np.ndarray) -> float:
            return 100.0

    walk = Walk(states=(0.5, 0.05, 0.005))
    outcome, _ = run(Scaled(lambda u: 3.0 * u), walk, None, ONE, stop=StoppingTest(tolerance=2e-3))
    assert outcome.residual_absolute == pytest.approx(0.15)
    assert [row["residual_absolute"] for row in outcome.rows] == [3.0 * state for state in (1.0, 0.5, 0.05)]


def test_stopping_by_difference_wants_two_steps() -> None:
    walk = Walk(states=(2.0, 2.0 + 1e-7))
    outcome, _ = run(IDENTITY, walk, None, ONE, stop=StoppingTest(kind="difference", tolerance=1e-6))
    assert outcome.status is Status.CONVERGED
    assert len(outcome.rows) == 3
    assert outcome.rows[-1]["difference"] == pytest.approx(0.5e-7, rel=1e-6)
    assert np.isnan(outcome.rows[0]["difference"])


def test_stopping_by_claim_believes_the_method() -> None:
    walk = Walk(states=(0.9, 0.8, 0.7), claims_from=2)
    outcome, _ = run(IDENTITY, walk, None, ONE, stop=StoppingTest(kind="claim"))
    assert outcome.status is Status.CONVERGED
    assert outcome.state[0] == 0.8
    assert outcome.residual_norm == 0.8  # and the residual that counts is told all the same
    assert outcome.claimed_wrongly
    assert not outcome.denied_wrongly


# What the method says against what is.


@pytest.mark.parametrize(("claim", "state", "wrongly"), [(True, 0.5, True), (True, 0.0, False), (None, 0.5, False)])
def test_a_claim_is_verified_whatever_stops_the_method(claim: bool | None, state: float, wrongly: bool) -> None:
    outcome, _ = run(IDENTITY, Says(state=state, claim=claim), None, ONE)
    assert outcome.claimed_wrongly == wrongly
    assert (outcome.status is Status.CONVERGED) == (state == 0.0)


@pytest.mark.parametrize(("state", "wrongly"), [(0.0, True), (0.5, False)])
def test_a_denial_is_verified(state: float, wrongly: bool) -> None:
    outcome, _ = run(IDENTITY, Says(state=state, claim=False), None, ONE)
    assert outcome.denied_wrongly == wrongly
    assert not outcome.claimed_wrongly


def test_a_method_that_breaks_down_at_a_solution_denied_wrongly() -> None:
    stop = StoppingTest(kind="difference", tolerance=1e-12)
    outcome, _ = run(IDENTITY, Says(state=1e-9, claim=None, breaks=True), None, ONE, stop=stop)
    assert outcome.status is Status.STAGNATED
    assert outcome.denied_wrongly


def test_equal_iterates_far_from_a_solution_are_a_wrong_claim_of_the_test_of_differences() -> None:
    stop = StoppingTest(kind="difference", tolerance=1e-3)
    outcome, _ = run(IDENTITY, Walk(states=(0.5, 0.5)), None, ONE, stop=stop)
    assert outcome.status is Status.CONVERGED
    assert outcome.claimed_wrongly


def test_a_failed_solve_names_its_worst_equation() -> None:
    tilted = Scalar(lambda u: np.array([1.0, 5.0, 2.0]) * u)
    outcome, _ = run(tilted, Walk(states=(0.5,)), None, np.ones(3))
    assert outcome.blame == {"blame_unknown": 1}


@pytest.mark.parametrize(
    ("norm", "expected"),
    [
        ("euclidean", np.sqrt(0.3**2 + 0.1**2) / np.sqrt(3.0**2 + 4.0**2 + 0.1**2 + 0.2**2)),
        ("maximum", 0.3 / 4.0),
        ("components", 0.1 / np.hypot(0.1, 0.2)),
    ],
)
def test_norms_of_a_difference(norm: Any, expected: float) -> None:
    """u = (3, 4) in x and (0.1, 0.2) in y; the change is 0.3 in x and 0.1 in y of the second node."""
    state = np.array([3.0, 0.1, 4.0, 0.2])
    change = np.array([0.0, 0.0, 0.3, 0.1])
    assert StoppingTest(kind="difference", norm=norm).difference(state, state - change) == pytest.approx(expected)


def test_difference_of_and_from_rest() -> None:
    test = StoppingTest(kind="difference")
    assert test.difference(np.zeros(4), np.zeros(4)) == 0.0
    assert test.difference(np.zeros(4), np.ones(4)) == np.inf


@pytest.mark.parametrize(
    ("component", "fields"),
    [
        (StoppingTest, {"tolerance": 0.0}),
        (StoppingTest, {"tolerance": -1e-8}),
        (StoppingTest, {"tolerance": float("nan")}),
        (StoppingTest, {"kind": "luck"}),
        (StoppingTest, {"norm": "taxicab"}),
        (Budget, {"iterations": 0}),
    ],
)
def test_nonsense_is_refused(component: type[Any], fields: dict[str, Any]) -> None:
    with pytest.raises(ValidationError, match=next(iter(fields))):
        component(**fields)
