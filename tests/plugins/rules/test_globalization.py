"""Step lengths: what each search asks for, on scripted residuals and against closed forms; and the nested field."""

from __future__ import annotations

import tomllib
from itertools import pairwise
from pathlib import Path
from typing import Any, Literal

import numpy as np
import pytest
from cases import near, run, spin_flow
from fakes import Plugin
from nlsolve_rules import Backtracking, Cubic, Energy, FullSteps, Goldstein, NonMonotone
from nlsolve_rules.least_residual import interpolated
from nlsolve_rules.refresh import EveryIteration, Never
from nlsolve_solvers import Anderson, Broyden, Newton
from nlsolve_solvers.modified_newton import ModifiedNewton
from pydantic import ValidationError
from scipy.sparse import csr_array

from nlsolve import Status, Study
from nlsolve.plugin import Globalization
from nlsolve.registry.problems import StudyError
from nlsolve.registry.registry import Registry, load_registry
from nlsolve.series import Array
from nlsolve.solving.driver import solve
from nlsolve.solving.stopping import Budget, StoppingTest
from nlsolve.solving.tangent import Tangent
from nlsolve.solving.work.counted_problem import CountedProblem
from nlsolve.solving.work.ledger import Ledger
from nlsolve.testing import check_globalization
from nlsolve.testing.toy_problem import DenseLU, ToyProblem

KINDS: tuple[Globalization, ...] = (FullSteps(), Backtracking(), NonMonotone(), Cubic(), Goldstein(), Energy())
ONE = np.ones(1)


@pytest.mark.parametrize("globalization", KINDS, ids=lambda component: component.kind)
def test_globalizations_conform(globalization: Globalization) -> None:
    check_globalization(globalization)


class Scripted(ToyProblem):
    """‖R(u + t w)‖ as written down, in order of asking; remembers where it was asked."""

    def __init__(self, *sizes: float) -> None:
        self.sizes, self.asked = list(sizes), list[float]()

    def residual(self, u: Any) -> Any:
        self.asked.append(float(u[0]))
        return np.array([self.sizes.pop(0)])


def taken(
    globalization: Globalization, *sizes: float, predicted_decrease: float = 1.0
) -> tuple[float, float, list[float]]:
    """Length and ‖R‖ of one step from ‖R‖ = 1, and the lengths that were tried."""
    problem = Scripted(*sizes)
    length, residual = globalization.search(problem).length(problem, 0.0 * ONE, ONE, ONE, predicted_decrease)
    return length, float(residual[0]), problem.asked


def test_full_steps_are_full() -> None:
    assert taken(FullSteps(), 1e9) == (1.0, 1e9, [1.0])


def test_backtracking_halves_until_the_residual_falls() -> None:
    assert taken(Backtracking(), 3.0, 1.5, 0.9) == (0.25, 0.9, [1.0, 0.5, 0.25])


def test_as_much_must_be_gained_as_a_part_of_what_is_promised() -> None:
    """1 − 10⁻⁴ t (1 − η): a decrease by 5·10⁻⁵ is enough for η = 0.9 only."""
    assert taken(Backtracking(), 1.0 - 5e-5, predicted_decrease=0.1)[0] == 1.0
    assert taken(Backtracking(), 1.0 - 5e-5, 0.5)[0] == 0.5


def test_a_search_that_finds_no_decrease_takes_the_smallest_residual() -> None:
    assert taken(Backtracking(trials=2), 3.0, 1.5, 2.0) == (0.5, 1.5, [1.0, 0.5, 0.25])
    assert taken(Backtracking(trials=2), np.nan, 2.0, np.nan)[:2] == (0.5, 2.0)


def test_a_non_monotone_search_bears_growth_up_to_the_largest_of_its_memory() -> None:
    for memory, expected in ((1, 0.5), (10, 1.0)):
        search = NonMonotone(memory=memory).search(ToyProblem())
        search.length(Scripted(1.0), 0.0 * ONE, 2.0 * ONE, ONE)
        length, residual = search.length(Scripted(1.5, 0.9), 0.0 * ONE, ONE, ONE)
        assert length == expected
        assert residual[0] == {1: 0.9, 10: 1.5}[memory]


def test_the_first_interpolation_is_a_parabola() -> None:
    """‖R‖² = 1 − 2 t + 5 t² through ‖R(1)‖ = 2: least at t = 0.2; and no shorter than a tenth at once."""
    for first, expected in ((2.0, 0.2), (100.0, 0.1), (1.001, 0.4995), (np.inf, 0.1), (np.nan, 0.1)):
        length, *_ = taken(Cubic(), first, 0.5)
        assert length == pytest.approx(expected, rel=1e-3)
    assert taken(Cubic(), 2.0, 0.5, predicted_decrease=0.5)[0] == pytest.approx(0.125)  # 1 − t + 4 t²


@pytest.mark.parametrize(("c", "d"), [(4.0, 2.0), (3.0, 0.0), (9.0, -3.0)])
def test_later_interpolations_are_cubics(c: float, d: float) -> None:
    """φ = 1 − 2 t + c t² + d t³ is least where 3 d t² + 2 c t = 2."""
    tried = [(t, float(np.sqrt(1.0 - 2.0 * t + c * t**2 + d * t**3))) for t in (1.0, 0.4)]
    roots = np.roots([3.0 * d, 2.0 * c, -2.0]) if d else np.array([1.0 / c])
    least = min(root for root in roots if root > 0.0)
    assert interpolated(tried, 1.0) == pytest.approx(np.clip(least, 0.04, 0.2), rel=1e-9)


def test_a_cubic_without_a_least_point_takes_the_shortest_length() -> None:
    assert interpolated([(1.0, 1.0), (0.5, 1e6)], 1.0) == pytest.approx(0.05)


def test_goldsteins_bounds_cut_a_step_that_hardly_gains() -> None:
    """‖R‖² ≤ 1 − 2 c t: at t = 1, c = 0.1, ‖R‖ ≤ 0.894. The parabola through 1 and 0.81 = 0.9² has its least point at
    1/1.81.
    """
    assert taken(Goldstein(), 0.7) == (1.0, 0.7, [1.0])
    length, _, asked = taken(Goldstein(), 0.9, 0.6)
    assert asked == pytest.approx([1.0, 0.5])
    assert length == 0.5
    assert taken(Goldstein(fraction=0.05), 0.9)[0] == 1.0


def test_goldsteins_bounds_lengthen_a_step_that_gains_all_it_can() -> None:
    """‖R‖² ≥ 1 − 2 (1 − c) t: after t = 1 has failed and 0.1 has gained more than 0.18, t is bisected between them."""
    length, size, asked = taken(Goldstein(), 1e3, 0.9, 0.5)
    assert asked == pytest.approx([1.0, 0.1, 0.55])
    assert (length, size) == (pytest.approx(0.55), 0.5)
    asked = taken(Goldstein(), 1e3, 0.9, 2.0, 0.7)[2]
    assert asked == pytest.approx([1.0, 0.1, 0.55, 0.325])


def test_goldsteins_search_takes_the_best_length_where_none_will_do() -> None:
    assert taken(Goldstein(trials=2), 3.0, 1.5, 2.0)[:2] == (pytest.approx(0.1), 1.5)
    assert taken(Goldstein(trials=1), np.nan, 2.0)[1] == 2.0


@pytest.mark.parametrize("size", [0.0, 1.0])
def test_goldsteins_search_of_a_solved_or_inexact_step_is_a_full_one(size: float) -> None:
    problem = Scripted(0.9)
    search = Goldstein().search(problem)
    assert search.length(problem, 0.0 * ONE, size * ONE, ONE, 0.2)[0] == 1.0


@pytest.mark.parametrize(
    "globalization", [Backtracking(), Cubic(), Goldstein(), NonMonotone(), Energy()], ids=lambda g: g.kind
)
def test_newton_is_led_home_from_far_away_where_full_steps_are_not(globalization: Globalization) -> None:
    """F = arctan, whose full steps grow from |u| > 1.39."""

    class Arctan(ToyProblem):
        is_gradient = True

        def residual(self, u: Any) -> Any:
            return np.arctan(u)

        def jacobian(self, u: Array) -> Any:
            return csr_array(np.diag(1.0 / (1.0 + u**2)))

    start = np.full(1, 3.0)
    lost, _ = run(Arctan(), Newton(globalization=FullSteps()), EveryIteration(), start, DenseLU(), iterations=3)
    home, _ = run(Arctan(), Newton(globalization=globalization), EveryIteration(), start, DenseLU(), iterations=20)
    assert abs(lost.state[0]) > 1e4
    assert home.status is Status.CONVERGED
    assert abs(home.state[0]) < 1e-9


# Methods and their lengths.


@pytest.mark.parametrize("solver", [Anderson, Broyden, ModifiedNewton], ids=lambda cls: cls.__name__)
def test_what_a_search_tries_is_in_the_ledger(solver: Any) -> None:
    """K* of another state, made where sinh is flat: it proposes too much."""
    ledger = Ledger()
    tangent = Tangent(DenseLU(), Never(), ledger)
    problem, far = ToyProblem(), ToyProblem.solution + 3.0
    tangent.refresh_if_due(lambda: problem.jacobian(np.zeros(12)))
    outcome = solve(
        problem,
        solver(globalization=Backtracking()),
        tangent,
        far,
        StoppingTest(tolerance=1e-10),
        Budget(iterations=400),
        ledger,
    )
    assert outcome.status is Status.CONVERGED
    lengths = [row["length"] for row in outcome.rows[1:]]
    assert min(lengths) < 1.0
    assert ledger.counts["residual"] >= len(outcome.rows) + sum(length < 1.0 for length in lengths)


class Halfway(Globalization):
    """t = ½ throughout: a stranger's."""

    kind: Literal["halfway"] = "halfway"

    def search(self, problem: Any) -> Any:
        class Half:
            def length(
                self, problem: Any, state: Any, residual: Any, direction: Any, predicted_decrease: float = 1.0
            ) -> Any:
                return 0.5, problem.residual(state + 0.5 * direction)

        return Half()


def test_broyden_with_short_steps_is_the_updated_matrix_too() -> None:
    """B ← B + (y − B s) sᵀ/(sᵀs) with s = w/2, from a K* that is not the tangent."""
    flow, other = spin_flow(0.5), spin_flow(0.6)
    ledger = Ledger()
    tangent = Tangent(DenseLU(), Never(), ledger)
    start = near(flow, 0.52)
    tangent.refresh_if_due(lambda: other.jacobian(start))
    steps = Broyden(globalization=Halfway()).steps(CountedProblem(flow, ledger), tangent, start)
    matrix = other.jacobian(start).toarray()
    for u, following in pairwise([next(steps).state for _ in range(6)]):
        s = -0.5 * np.linalg.solve(matrix, flow.residual(u))
        np.testing.assert_allclose(following - u, s, atol=1e-7 * np.linalg.norm(s))
        y = flow.residual(u + s) - flow.residual(u)
        matrix += np.outer(y - matrix @ s, s) / (s @ s)


# The nested field.


def test_a_table_becomes_the_installed_component_and_a_component_stays() -> None:
    solver = Newton(globalization={"kind": "cubic", "trials": 3})
    assert solver.globalization == Cubic(trials=3)
    assert Newton(globalization=Energy()).globalization == Energy()
    assert Newton().globalization == Backtracking()
    assert Broyden().globalization == FullSteps()
    assert solver.with_(globalization={"kind": "none"}).globalization == FullSteps()
    assert Newton.model_validate_json(solver.model_dump_json()) == solver


def test_a_strangers_globalization_is_taken() -> None:
    registry = Registry()
    registry.add(Plugin(Halfway, Backtracking), "a stranger 1.0")
    with registry.in_use():
        solver = Newton.model_validate({"globalization": {"kind": "halfway"}})
    outcome, _ = run(ToyProblem(), solver, EveryIteration(), ToyProblem.solution + 0.5, DenseLU())
    assert {row["length"] for row in outcome.rows[1:]} == {0.5}
    assert solver.model_dump() == {"kind": "newton", "globalization": {"kind": "halfway"}}


@pytest.mark.parametrize(
    ("given", "place", "sentence"),
    [
        ({"kind": "cubik"}, ("globalization",), "no such globalization; did you mean 'cubic'"),
        ({"trials": 3}, ("globalization",), "required, and missing; installed: backtracking, cubic"),
        ({"kind": "cubic", "trials": 0}, ("globalization", "trials"), "greater than 0"),
        ({"kind": "none", "trials": 3}, ("globalization", "trials"), "Extra inputs are not permitted"),
        ("cubic", ("globalization",), "should be a table with a kind"),
    ],
)
def test_what_is_wrong_is_told_in_its_own_place(given: Any, place: tuple[str, ...], sentence: str) -> None:
    with pytest.raises(ValidationError) as caught:
        Newton(globalization=given)
    (detail,) = caught.value.errors()
    assert detail["loc"] == place
    assert sentence in detail["msg"]


STUDY = Path(__file__).parents[3] / "studies" / "first.toml"


def study(values: Any, name: str = "solver.globalization") -> Study:
    """The first study with Newton's globalisation swept instead."""
    settings: dict[str, Any] = {"solver": {"kind": "newton"}, "sweep": [{"grid": {name: values}}], "table": []}
    document = tomllib.loads(STUDY.read_text()) | settings | {"figure": []}
    return Study.from_dict(document)


def test_globalizations_are_swept_and_part_of_a_cases_identity() -> None:
    cases = study(["none", "backtracking", "cubic"], "solver.globalization.kind").cases
    assert len({case.id for case in cases}) == 3
    assert [case.label for case in cases] == [
        f"solver.globalization.kind = {k}" for k in ("none", "backtracking", "cubic")
    ]
    assert [case.parts.solver.globalization for case in cases] == [FullSteps(), Backtracking(), Cubic()]
    (short, long) = study([{"kind": "cubic", "trials": 2}, {"kind": "cubic"}]).cases
    assert short.id != long.id
    assert short.parameters["solver.globalization.trials"] == 2
    assert "solver.globalization.trials" in short.swept


@pytest.mark.parametrize(
    ("value", "sentence"),
    [
        ({"kind": "cubik"}, "solver.globalization.kind = 'cubik': no such globalization; did you mean 'cubic'?"),
        ({"kind": "cubic", "trails": 2}, "solver.globalization.trails = 2: no such field; did you mean 'trials'?"),
        ({"kind": "cubic", "trials": 0}, "solver.globalization.trials = 0: should be greater than 0"),
        ({"trials": 4}, "solver.globalization.kind: required, and missing; installed: backtracking"),
    ],
)
def test_a_mistake_in_a_study_is_told_with_its_place(value: Any, sentence: str) -> None:
    with pytest.raises(StudyError) as caught:
        study([value])
    assert sentence in str(caught.value)


def test_nested_kinds_are_listed_among_the_plugins() -> None:
    rows = {row.kind: row for row in load_registry().plugins() if row.noun == "globalization"}
    assert set(rows) == {"none", "backtracking", "cubic", "goldstein", "non-monotone", "energy"}
    assert [parameter.name for parameter in rows["non-monotone"].parameters] == ["trials", "measure", "memory"]


def test_a_residual_beyond_all_bounds_shortens_the_step() -> None:
    """‖R‖ grows 1e200-fold along the full step: its square is no number any more, and the step is cut all the same."""
    state = np.zeros(12)
    residual = ToyProblem().residual(state)
    search = Cubic(trials=30).search(ToyProblem())
    with np.errstate(all="ignore"):  # as the driver has it
        length, shorter = search.length(ToyProblem(), state, residual, -300.0 * residual)
    assert length < 0.01
    assert np.linalg.norm(shorter) < np.linalg.norm(residual)
