"""Unit costs by a clock that can be told, predictions by hand, lines against brute force, reports and pictures."""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import numpy as np
import pandas as pd
import pytest
from cases import PLAIN, near, run, setup, spin_flow
from fakes import STUDY, registry_of, write_study
from hypothesis import given
from hypothesis import strategies as st
from matplotlib.figure import Figure
from nlsolve_rules.refresh import EveryIteration, PoorContraction
from nlsolve_scenes import StirringTool
from nlsolve_scenes.nodes.rings import Rings
from nlsolve_solvers import Newton
from nlsolve_solvers.homotopy import AsymptoticNumericalMethod
from nlsolve_solvers.modified_newton import ModifiedNewton
from pydantic import TypeAdapter, ValidationError

import nlsolve
from nlsolve import Outcome, SolveError, Status
from nlsolve.plugin import Factors, LinearSolver, NodeMotion, NonlinearProblem, Physics, TimeSteps
from nlsolve.registry.problems import StudyError
from nlsolve.results.columns import RUNS
from nlsolve.results.costs.cost_prediction import UNITS, with_predictions
from nlsolve.results.costs.crossover import OTHER, SAME, TIE, Crossover
from nlsolve.results.costs.lower_envelope import at_best, lower_envelope, under, wins
from nlsolve.results.costs.unit_costs import COUNTS, UnitCosts
from nlsolve.results.frames import Frames
from nlsolve.running.forecast import forecast
from nlsolve.running.runner import run as run_study
from nlsolve.running.timing.calibration import ORDER, calibrate, measure
from nlsolve.show.figures import BaseFigure, FigureError, FigureSpec, draw, drawn
from nlsolve.show.figures.style import ACCENT
from nlsolve.show.tables import TableSpec, build
from nlsolve.solving.simulate import Record
from nlsolve.solving.simulate import run_case as march
from nlsolve.solving.work.ledger import Ledger
from nlsolve.study.study import Study
from nlsolve.testing.toy_problem import ToyProblem

UNIT = UnitCosts(
    residual=2.0,
    expansion=3.0,
    jacobian=20.0,
    matrix_product=1.0,
    factorization=100.0,
    triangular_solve=4.0,
    series_order=5.0,
    series_term=0.5,
)


# Unit costs.


class Clock:
    """Tells the seconds it has been given."""

    def __init__(self) -> None:
        self.now = 0.0

    def __call__(self) -> float:
        return self.now


class Priced(NonlinearProblem):
    """ToyProblem whose work takes the seconds of UNIT, times `pace`; the second of each kind takes much longer."""

    def __init__(self, clock: Clock, pace: float) -> None:
        self.clock, self.pace, self.small = clock, pace, ToyProblem()
        self.calls: dict[str, int] = {}

    def spend(self, kind: str, seconds: float) -> None:
        self.calls[kind] = self.calls.get(kind, 0) + 1
        self.clock.now += self.pace * seconds * (50.0 if self.calls[kind] == 2 else 1.0)

    def residual(self, u: Any) -> Any:
        self.spend("residual", UNIT.residual)
        return self.small.residual(u)

    def jacobian(self, u: Any) -> Any:
        self.spend("jacobian", UNIT.jacobian)
        problem = self

        class Matrix:
            def __matmul__(self, x: Any) -> Any:
                problem.spend("product", UNIT.matrix_product)
                return problem.small.jacobian(u) @ x

        return Matrix()

    def expand(self, u: Any) -> Any:
        self.spend("expansion", UNIT.expansion)
        inner, problem = self.small.expand(u), self

        class Expansion:
            def coefficient(self, j: int) -> Any:
                if j:
                    problem.spend(f"order {j}", UNIT.series_order + j * UNIT.series_term)
                return inner.coefficient(j)

            append = staticmethod(inner.append)

        return Expansion()


class PricedSolver(LinearSolver):
    """The linear solver to go with it."""

    problem: Any

    def factorize(self, matrix: Any, previous: Factors | None = None) -> Factors:
        self.problem.spend("factorization", UNIT.factorization * (1.0 if previous else 3.0))  # trials of orderings
        problem = self.problem

        class PricedFactors(Factors):
            def solve(self, rhs: Any) -> Any:
                problem.spend("solve", UNIT.triangular_solve)
                return rhs

        return PricedFactors()


def test_unit_costs_are_the_medians_of_rounds_and_the_line_through_the_orders() -> None:
    clock, pace = Clock(), 1e-6
    problem = Priced(clock, pace)
    found = measure(problem, PricedSolver(problem=problem), ToyProblem.solution, rounds=5, clock=clock)
    assert problem.calls["jacobian"] >= 5
    assert found.columns() == pytest.approx({name: pace * price for name, price in UNIT.columns().items()})
    assert found.ratio == pytest.approx(25.0)


def test_no_round_is_begun_after_enough_seconds() -> None:
    clock = Clock()
    problem = Priced(clock, pace=1.0)  # its first factorisation takes longer than enough
    measure(problem, PricedSolver(problem=problem), ToyProblem.solution, rounds=9, clock=clock)
    assert problem.calls["factorization"] == 1 + 2
    assert problem.calls["residual"] == 2 * ORDER


def test_a_tangent_that_cannot_be_factorised_is_an_error_with_its_status() -> None:
    flow = spin_flow(0.5)
    with pytest.raises(SolveError) as caught:
        measure(flow, PLAIN, np.full(len(near(flow, 0.7)), np.nan), rounds=1)
    assert caught.value.status is Status.NON_FINITE


def test_calibration_of_a_case_is_finite_and_predicts_more_for_more_work() -> None:
    marched = {"time": TimeSteps(horizon=2e-4), "motion": NodeMotion(nodes="lagrangian")}
    case = setup(StirringTool(nodes=Rings(spacing=0.75)), physics=Physics(inertia=True), **marched)
    found = calibrate(case, rounds=2)
    unit = found.unit
    assert unit is not None
    cloud = case.scene.cloud(case.law)
    assert (found.sizes["nodes"], found.sizes["unknowns"]) == (len(cloud.nodes), 2 * len(cloud.interior))
    assert found.operators > 0.0
    costs = np.array(list(unit.columns().values()))
    assert np.isfinite(costs).all()
    assert (costs[:-2] > 0.0).all()
    assert (costs[-2:] >= 0.0).all()
    assert costs[-2:].sum() > 0.0
    less, more = unit.predict({"triangular_solves": 3}), unit.predict({"triangular_solves": 3, "residuals": 1})
    assert 0.0 < less < more


def test_a_bad_cloud_cannot_be_calibrated_and_a_forecast_leaves_it_open() -> None:
    document = {
        "question": "?",
        "scene": {"kind": "stirring-tool", "nodes": {"kind": "rings", "spacing": 0.75}},
        "law": {"kind": "power-law", "index": 0.5},
        "discretizer": {"kind": "mls", "support": 5000},
        "solver": {"kind": "newton"},
    }
    study = Study.from_dict(document)
    assert calibrate(study.cases[0].parts).unit is None
    plan = forecast(study)
    assert plan[["seconds_operators", "seconds_factorization", "seconds", "seconds_all"]].isna().all(axis=None)
    assert plan["nodes"].tolist() == [216]  # the cloud itself is there


def test_the_state_of_a_sample_is_the_newtonian_flow() -> None:
    case = setup(StirringTool(nodes=Rings(spacing=0.75)), index=0.3)
    ledger = Ledger()
    flow, state = case.scene.simulation(case, ledger.entry).sample()
    newtonian = march(setup(StirringTool(nodes=Rings(spacing=0.75)), index=1.0))
    assert newtonian.state is not None
    assert np.allclose(state, newtonian.state, rtol=1e-8, atol=1e-8)
    assert flow.law == case.law
    assert ledger.counts["operators"] == 1


# Predictions.


def test_prediction_by_hand() -> None:
    counts = {
        "residuals": 10,
        "expansions": 4,
        "jacobians": 2,
        "matrix_products": 7,
        "factorizations": 3,
        "triangular_solves": 11,
        "series_orders": 6,
        "series_terms": 12,
    }
    assert set(counts) == set(COUNTS) < set(RUNS)
    assert UNIT.predict(counts) == 6 * 2 + 4 * 3 + 2 * 20 + 7 * 1 + 3 * 100 + 11 * 4 + 6 * 5 + 12 * 0.5
    assert UNIT.predict({}) == 0.0
    assert UnitCosts.of_columns(UNIT.columns()) == UNIT


@pytest.mark.parametrize(
    ("solver", "rule"),
    [
        (Newton(), EveryIteration()),
        (ModifiedNewton(), PoorContraction()),
        (AsymptoticNumericalMethod(order=8), PoorContraction()),
    ],
    ids=lambda part: part.kind,
)
def test_the_counts_of_a_run_account_for_all_its_work(solver: Any, rule: Any) -> None:
    """Σ_kind seconds + own work = seconds in the method; orders 1 … p − 1 of each series are p (p − 1)/2 terms."""
    flow = spin_flow(0.5)
    outcome, ledger = run(flow, solver, rule, near(flow, 0.7))
    assert outcome.status is Status.CONVERGED
    details = ledger.details()
    counts = ledger.counts
    assert details["expansions"] == (counts["residual"] if solver.kind == "anm" else 0)
    assert details["series_terms"] == counts["series_order"] * 8 / 2  # orders 1 … 7 of each series
    assert 0.0 < details["seconds_own"] < ledger.seconds["method"]
    kinds = ("residual", "jacobian", "matrix_product", "factorization", "triangular_solve", "series_order")
    parts = sum(ledger.seconds[kind] for kind in kinds)
    assert parts + details["seconds_own"] == pytest.approx(ledger.seconds["method"])


def test_seconds_are_told_by_the_clock_that_is_given() -> None:
    ticks = iter(np.arange(0.0, 1e6))
    row = march(setup(StirringTool(nodes=Rings(spacing=0.75))), clock=lambda: float(next(ticks))).summary
    work = row["factorizations"] + row["triangular_solves"] + row["jacobians"] + row["residuals"]
    assert row["seconds_factorization"] == row["factorizations"]  # a tick for each
    # Each piece ticks twice, each step of the method once more for its own beginning and end.
    assert row["seconds"] == 2 * work + row["iterations"] + 1


RHO = {"fine": 40.0, "coarse": 10.0, "steep": 200.0}
STRATEGIES = {"newton": (50, 60, 1), "chord": (4, 200, 2), "series": (1, 900, 3)}


def frame(own: float = 0.5, **columns: Any) -> pd.DataFrame:
    """Runs of three strategies by three linear solvers at two sizes, each taking what its work costs by UNIT and ρ."""
    rows = []
    for nodes in (100, 400):
        for backend, rho in RHO.items():
            unit = UnitCosts(**{**UNIT.__dict__, "factorization": rho * UNIT.triangular_solve})
            for place, (strategy, (factorizations, solves, iterations)) in enumerate(STRATEGIES.items()):
                counts = dict.fromkeys(COUNTS, 0) | {"factorizations": factorizations, "triangular_solves": solves}
                counts |= {"residuals": solves}
                seconds = unit.predict(counts) + own * iterations
                rows.append(
                    {"case": f"{nodes} {backend} {strategy}", "status": "converged", "nodes": nodes}
                    | {"iterations": iterations, "seconds": seconds, "seconds_most": 1.05 * seconds, "rounds": 2}
                    | {"seconds_own": own * iterations, **counts, **unit.columns(), "variant": strategy}
                    | {"scene.nodes": nodes, "linear.ordering": backend, "solver.number": place}
                )
    runs = pd.DataFrame(rows).assign(**columns)
    return runs.reindex(columns=[*RUNS, *(name for name in runs if name not in RUNS)])


def told(own: float = 0.5, **columns: Any) -> pd.DataFrame:
    return with_predictions(frame(own, **columns))


def records(runs: pd.DataFrame) -> list[dict[str, Any]]:
    return [dict(zip(map(str, runs.columns), row, strict=True)) for row in runs.itertuples(index=False)]


def test_predictions_are_exact_for_exact_runs() -> None:
    runs = told()
    assert runs["seconds_predicted"].to_numpy(float) == pytest.approx(runs["seconds"].to_numpy(float), rel=1e-12)


def test_a_prediction_does_not_look_at_the_seconds_of_its_own_run() -> None:
    runs = frame()
    slow = runs["case"] == "100 fine chord"
    seen = with_predictions(runs.assign(seconds=runs["seconds"].where(~slow, 1e6), seconds_own=np.where(slow, 7e5, 1)))
    without = with_predictions(runs.assign(seconds_own=1.0))
    assert seen["seconds_predicted"][slow].item() == without["seconds_predicted"][slow].item()


def test_own_work_is_left_out_where_no_other_linear_solver_tells_it() -> None:
    runs = told().query("`linear.ordering` == 'fine'")
    alone = with_predictions(runs)
    missing = runs["seconds"] - alone["seconds_predicted"]
    assert missing.to_numpy(float) == pytest.approx(0.5 * runs["iterations"].to_numpy(float))


def test_unit_costs_are_medians_over_the_runs_of_a_cell() -> None:
    runs = frame()
    one = runs["case"] == "100 fine newton"
    odd = runs.assign(**{"unit.triangular_solve": runs["unit.triangular_solve"].where(~one, 1e3)})
    assert with_predictions(odd)["seconds_predicted"].to_numpy(float) == pytest.approx(runs["seconds"].to_numpy(float))


def test_without_unit_costs_nothing_is_predicted() -> None:
    runs = frame().assign(**dict.fromkeys(UNITS, np.nan))
    assert with_predictions(runs) is runs
    half = frame()
    half.loc[half["linear.ordering"] == "fine", list(UNITS)] = np.nan
    found = with_predictions(half)
    assert found["seconds_predicted"].isna().sum() == 6
    crashed = frame()
    crashed.loc[0, ["iterations", *COUNTS]] = None
    assert with_predictions(crashed)["seconds_predicted"].isna().tolist() == [True] + [False] * 17


# Lines.

lines = st.lists(
    st.tuples(st.integers(0, 60), st.floats(1.0, 1e4, allow_subnormal=False)), min_size=1, max_size=8, unique=True
)


@given(lines, st.floats(0.0, 1e4))
def test_the_envelope_is_the_lowest_line_everywhere(drawn: list[tuple[int, float]], ratio: float) -> None:
    slopes, rests = np.array(drawn, dtype=float).T
    intervals = lower_envelope(slopes, rests)
    assert intervals[0][1] == 0.0
    assert intervals[-1][2] == np.inf
    assert all(high == low for (_, _, high), (_, low, _) in pairwise(intervals))
    (winner,) = [line for line, low, high in intervals if low <= ratio < high]
    costs = slopes * ratio + rests
    assert costs[winner] <= costs.min() * (1 + 1e-9)


@given(lines)
def test_a_line_at_its_best_is_as_near_as_brute_force_finds_it(drawn: list[tuple[int, float]]) -> None:
    slopes, rests = np.array(drawn, dtype=float).T
    intervals = lower_envelope(slopes, rests)
    ends = [low for _, low, _ in intervals]
    across = np.r_[ends, np.geomspace(1e-3, 1e7, 400)]
    costs = slopes[:, None] * across + rests[:, None]
    factors = (costs / costs.min(axis=0)).min(axis=1)
    for line in range(len(slopes)):
        words = at_best(line, slopes, rests, intervals)
        if words == "1":
            assert factors[line] == pytest.approx(1.0)
        else:
            assert float(words.split()[0]) == pytest.approx(factors[line], rel=0.01)


@given(st.integers(-50, 50), st.floats(-1e4, 1e4, allow_subnormal=False), st.floats(1e-3, 1e5))
def test_under_is_where_the_difference_is_negative(slope: int, rest: float, ratio: float) -> None:
    word, _, place = under(slope, rest).partition(" ")
    if place and abs(ratio / float(place) - 1.0) < 0.01:
        return  # too near the crossing for its three digits
    expected = {"always": True, "never": False, "above": ratio > float(place or 0), "below": ratio < float(place or 0)}
    assert (slope * ratio + rest < 0.0) == expected[word]


def test_wins_for_people() -> None:
    intervals = lower_envelope([50, 4, 1], [10.0, 56.0, 500.0])
    assert [wins(line, intervals) for line in range(3)] == ["0 … 1", "1 … 148", "148 … ∞"]
    assert wins(1, lower_envelope([50, 60, 1], [10.0, 56.0, 500.0])) == "never"


# The reports.


def test_cells_of_exact_runs() -> None:
    rows = Crossover().of(records(told()))
    assert [(row["size"], row["backend"], row["verdict"]) for row in rows[:3]] == [
        ("nodes 100", "fine", SAME),
        ("nodes 100", "coarse", SAME),
        ("nodes 100", "steep", SAME),
    ]
    assert [row["ratio"] for row in rows[:3]] == pytest.approx([40.0, 10.0, 200.0])
    assert [row["measured"] for row in rows[:3]] == ["chord", "chord", "chord"]
    assert rows[0]["deviation"] == pytest.approx(0.0, abs=1e-12)
    assert rows[0]["spread"] == pytest.approx(0.05)
    assert rows[-1]["verdict"] == "6 of 6 same, 6 with ties"


@pytest.mark.parametrize(("factor", "verdict"), [(1.0, SAME), (1.04, TIE), (1.06, OTHER)])
def test_a_tie_is_within_the_rounds_of_the_winner(factor: float, verdict: str) -> None:
    """The predicted winner came in slower than a rival whose rounds spread by 5 %."""
    runs = told()
    rival, chord = (runs["case"] == f"100 fine {name}" for name in ("newton", "chord"))
    fastest = runs["seconds"][chord].item() / factor
    seconds = runs["seconds"].where(~rival, fastest if factor > 1.0 else 1e9)
    changed = runs.assign(seconds=seconds, seconds_most=1.05 * seconds)
    rows = Crossover().of(records(changed))
    assert rows[0]["verdict"] == verdict
    assert rows[0]["predicted"] == "chord"
    assert rows[0]["regret"] == pytest.approx(factor - 1.0)
    counts = {SAME: "6 of 6 same, 6 with ties", TIE: "5 of 6 same, 6 with ties", OTHER: "5 of 6 same, 5 with ties"}
    assert rows[-1]["verdict"] == counts[verdict]


def test_a_tie_in_the_exclusive_lane_is_within_the_interval_of_the_winner() -> None:
    """There the slowest of many rounds says nothing."""
    runs = told()
    rival, chord = (runs["case"] == f"100 fine {name}" for name in ("newton", "chord"))
    seconds = runs["seconds"].where(~rival, runs["seconds"][chord].item() / 1.04)
    for high, verdict in ((1.03, OTHER), (1.05, TIE)):
        changed = runs.assign(seconds=seconds, seconds_high=high * seconds, seconds_most=1.5 * seconds)
        assert Crossover().of(records(changed))[0]["verdict"] == verdict


def test_lines_of_exact_runs() -> None:
    rows = Crossover(report="lines", against="chord").of(records(told()))
    # The unit is the solve of the linear solver of median ρ; a residual costs half of it, an iteration an eighth.
    assert [row["factorizations"] for row in rows[:3]] == [50, 4, 1]
    assert [row["rest"] for row in rows[:3]] == pytest.approx([90.125, 300.25, 1350.375])
    assert [row["wins"] for row in rows[:3]] == ["0 … 4.57", "4.57 … 350", "350 … ∞"]
    assert [row["beats chord"] for row in rows[:3]] == ["below 4.57", "never", "above 350"]
    assert [row["at best"] for row in rows[:3]] == ["1", "1", "1"]
    assert [row["size"] for row in rows] == ["nodes 100"] * 3 + ["nodes 400"] * 3


def test_numbers_are_called_by_their_columns() -> None:
    runs = told(**{"discretizer.kind": "grid"})
    asked = Crossover(strategy="solver.number", size=["discretizer.kind", "nodes"], report="lines")
    rows = asked.of(records(runs))
    assert [(row["size"], row["strategy"]) for row in rows[:2]] == [
        ("grid, nodes 100", "number 0"),
        ("grid, nodes 100", "number 1"),
    ]


def test_failed_runs_take_no_part() -> None:
    runs = told()
    runs.loc[runs["variant"] == "chord", "status"] = "diverged"
    rows = Crossover().of(records(runs))
    assert {row["measured"] for row in rows[:-1]} == {"newton", "series"}


def spec(**fields: Any) -> TableSpec:
    return TableSpec.model_validate({"name": "t", "crossover": fields})


def test_tables_lay_themselves_out() -> None:
    table = build(spec(), told())
    assert list(table.cells.columns) == list(Crossover().shown)
    assert table.cells.loc[("nodes 100", "fine"), "predicted"] == "chord"
    assert table.cells.loc[("all", "–"), "verdict"] == "6 of 6 same, 6 with ties"
    lines = build(spec(report="lines", against="chord"), told())
    assert lines.words.loc[("nodes 400", "series"), "beats chord"] == "above 350"
    assert "4.57 … 350" in lines.markdown()


@pytest.mark.parametrize(
    ("fields", "sentence"),
    [
        ({"strategy": "variants"}, "'variants'|did you mean 'variant'"),
        ({"size": ["nodes", "node"]}, "did you mean 'nodes'"),
        ({"backend": "linear.order"}, "did you mean 'linear.ordering'"),
        ({"backend": "status"}, "3 runs are called 'newton' at nodes 100 with converged: name a column"),
    ],
)
def test_reports_refuse(fields: dict[str, Any], sentence: str) -> None:
    with pytest.raises(StudyError, match=sentence):
        build(spec(**fields), told())


def test_a_report_needs_unit_costs() -> None:
    with pytest.raises(StudyError, match="no run converged with unit costs"):
        build(spec(), frame())


@pytest.mark.parametrize(
    ("fields", "sentence"),
    [
        ({"rows": "nodes"}, "a crossover lays itself out; drop rows"),
        ({"count": True}, "drop count"),
        ({"crossover": {"report": "cell"}}, "'cells' or 'lines'"),
    ],
)
def test_a_table_is_a_crossover_or_another(fields: dict[str, Any], sentence: str) -> None:
    with pytest.raises(ValidationError, match=sentence):
        TableSpec.model_validate({"name": "t", "crossover": {}} | fields)


# The picture.

ADAPTER: TypeAdapter[BaseFigure] = TypeAdapter(FigureSpec)


def picture(runs: pd.DataFrame, **fields: Any) -> Figure:
    return draw(ADAPTER.validate_python({"kind": "crossover", "name": "c"} | fields), runs, runs, runs)


def test_marks_lie_on_the_lines_of_exact_runs() -> None:
    figure = picture(told())
    assert [axes.get_title() for axes in figure.axes] == [
        f"nodes {nodes}, winner predicted in 3 of 3" for nodes in (100, 400)
    ]
    panel = figure.axes[0]
    marks = [line.get_xydata()[0] for line in panel.lines if line.get_marker() not in ("None", None, "")]
    assert len(marks) == 9
    expected = [
        [rho, factorizations * rho + 1.5 * solves + iterations / 8]
        for factorizations, solves, iterations in STRATEGIES.values()
        for rho in RHO.values()
    ]
    assert np.array(marks, dtype=float) == pytest.approx(np.array(expected))
    (words,) = [[text.get_text() for text in legend.get_texts()] for legend in figure.legends]
    assert words == [*STRATEGIES, "cheapest by the lines"]


def test_the_data_beside_the_picture_has_a_row_a_mark_with_its_line() -> None:
    runs = told()
    _, data = drawn(ADAPTER.validate_python({"kind": "crossover", "name": "c"}), Frames(runs, runs, runs))
    assert len(data) == 2 * 9
    assert data["cost"].to_numpy() == pytest.approx(data["cost_predicted"].to_numpy())
    line = data["factorizations"] * data["factor_solve_ratio"] + data["rest"]
    assert data["cost_predicted"].to_numpy() == pytest.approx(line.to_numpy())
    assert list(dict.fromkeys(data["strategy"])) == list(STRATEGIES)
    assert list(dict.fromkeys(data["size"])) == ["nodes 100", "nodes 400"]


def test_a_mark_is_off_its_line_by_its_deviation_and_a_lost_cell_is_red() -> None:
    runs = told()
    one = runs["case"] == "400 coarse chord"
    figure = picture(runs.assign(seconds=runs["seconds"].where(~one, 5.0 * runs["seconds"])), where={"nodes": 400})
    (panel,) = figure.axes
    heights = [
        line.get_xydata()[0][1] for line in panel.lines if line.get_marker() == "s" and len(line.get_xydata()) == 1
    ]
    assert max(heights) == pytest.approx(5.0 * (4 * 10 + 300.25))
    assert panel.get_title() == "nodes 400, winner predicted in 2 of 3"
    assert [line.get_xdata()[0] for line in panel.lines if line.get_color() == ACCENT] == pytest.approx([10.0])


@pytest.mark.parametrize(
    ("runs", "fields", "sentence"),
    [
        (frame(), {}, "no run converged with unit costs"),
        (told(), {"backend": "linear.kind"}, "'linear.kind' is not in `runs`"),
        (told(), {"backend": "status"}, "3 runs are called 'newton'"),
    ],
)
def test_pictures_refuse(runs: pd.DataFrame, fields: dict[str, Any], sentence: str) -> None:
    with pytest.raises(FigureError, match=f'^figure "c": .*{sentence}'):
        picture(runs, **fields)


# Rounds.


@pytest.fixture
def timed(monkeypatch: pytest.MonkeyPatch) -> list[float]:
    """The seconds of the marches to come, in their order; the march itself is replaced."""
    seconds: list[float] = []

    def march_of(case: Any, listen: Any, clock: Any, **way: Any) -> Record:
        taken = seconds.pop(0)
        if taken < 0:
            raise ZeroDivisionError
        outcome = Outcome(Status.CONVERGED, "", np.zeros(1), 0.0)
        return Record({"status": "converged", "message": "", "seconds": taken, "tangents": 1}, outcome, pd.DataFrame())

    monkeypatch.setattr("nlsolve.running.engines.execution.run_case", march_of)
    return seconds


def study_of(tmp_path: Any, timing: str) -> Study:
    text = STUDY.replace('question = "How many branches?"', f'question = "?"\ntiming = {timing}')
    text = text.replace("[10, 20]", "[10]")
    return Study.from_toml(write_study(tmp_path, text=text), registry=registry_of())


def test_the_fastest_round_counts_and_the_rest_is_its_spread(tmp_path: Any, timed: list[float]) -> None:
    study = study_of(tmp_path, "{ rounds = 3 }")
    timed += [3.0, 10.0, 2.0, 12.0, 4.0, 11.0]  # case after case, round after round
    events: list[Any] = []
    runs = run_study(study, tmp_path / "out", listen=events.append).runs
    assert runs[["seconds", "seconds_most", "rounds"]].to_numpy(float).tolist() == [[2.0, 4.0, 3.0], [10.0, 12.0, 3.0]]
    assert runs["clock"].tolist() == ["processor", "processor"]
    assert [event.number for event in events if event.run is not None] == [1, 2, 3, 4, 5, 6]
    again = run_study(study, tmp_path / "out").runs
    assert again["seconds"].tolist() == [2.0, 10.0]


def test_rounds_may_be_added_later_but_not_by_another_clock(tmp_path: Any, timed: list[float]) -> None:
    timed += [3.0, 10.0]
    run_study(study_of(tmp_path, "{ rounds = 1 }"), tmp_path / "out")
    timed += [2.0, 12.0]
    runs = run_study(study_of(tmp_path, "{ rounds = 2 }"), tmp_path / "out").runs
    assert runs["seconds"].tolist() == [2.0, 10.0]
    timed += [5.0, 6.0]
    runs = run_study(study_of(tmp_path, '{ rounds = 1, clock = "wall" }'), tmp_path / "out").runs
    assert runs["seconds"].tolist() == [5.0, 6.0]
    assert runs["clock"].tolist() == ["wall"] * 2
    timed += [7.0, 8.0]
    runs = run_study(study_of(tmp_path, '{ clock = "wall", calibrate = true }'), tmp_path / "out").runs
    assert runs["seconds"].tolist() == [7.0, 8.0], "unit costs had not been measured"
    assert runs["unit.factorization"].isna().all(), "these marches leave no problem to be measured"


def test_a_round_that_crashes_is_told_and_tried_again(tmp_path: Any, timed: list[float]) -> None:
    timed += [3.0, 10.0, -1.0, 12.0]
    runs = run_study(study_of(tmp_path, "{ rounds = 2 }"), tmp_path / "out").runs
    assert runs["status"].tolist() == ["crashed", "converged"]
    timed += [4.0, 5.0]
    runs = run_study(study_of(tmp_path, "{ rounds = 2 }"), tmp_path / "out").runs
    assert runs["seconds"].tolist() == [4.0, 10.0]
    assert runs["seconds_most"].tolist() == [5.0, 12.0]


@pytest.mark.parametrize(
    ("place", "text"),
    [
        ("table[1]", '[[table]]\nname = "c"\ncrossover = { strategy = "solver.order", backend = "linear.kind" }'),
        (
            "figure[0]",
            '[[figure]]\nkind = "crossover"\nname = "f"\nstrategy = "solver.order"\nbackend = "linear.kind"',
        ),
    ],
)
def test_a_crossover_asks_for_calibration(tmp_path: Any, place: str, text: str) -> None:
    path = write_study(tmp_path, ("[quick]", f"{text}\n[quick]"))
    with pytest.raises(StudyError, match=r"set timing = \{ calibrate = true \}") as caught:
        Study.from_toml(path, registry=registry_of())
    assert place in str(caught.value)
    assert len(Study.from_toml(path, {"timing.calibrate": True}, registry=registry_of()).cases) == 4


def test_a_small_study_of_real_marches() -> None:
    """Two linear solvers, two strategies: predictions and a table, from the study on."""
    document = {
        "question": "who wins?",
        "scene": {"kind": "stirring-tool", "nodes": {"kind": "rings", "spacing": 1.0}},
        "law": {"kind": "power-law", "index": 0.5},
        "discretizer": {"kind": "delaunay"},
        "linear": {"kind": "superlu"},
        "solver": {"kind": "newton"},
        "start": {"values": [1.0]},
        "timing": {"calibrate": True, "clock": "processor"},
        "sweep": [
            {"grid": {"linear.ordering": ["mmd-ata", "natural"]}},
            {"each": [{"name": "newton"}, {"name": "anm", "solver": {"kind": "anm", "order": 8}}]},
        ],
        "table": [{"name": "cells", "crossover": {}}],
    }
    results = nlsolve.run(document)
    assert (results.runs["seconds_predicted"] > 0).all()
    assert (results.runs["unit.factorization"] > 0).all()
    assert results.table("cells").shape == (3, 7)
