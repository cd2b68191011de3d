"""Shares of problems solved: worked examples, what holds for any costs, what profiles show and what they refuse."""

from __future__ import annotations

from typing import Any

import numpy as np
import pandas as pd
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from pydantic import TypeAdapter, ValidationError
from scipy.stats import binom

from nlsolve.results.parameters import differing_parameters
from nlsolve.results.profiles import band, ratios, wilson, within
from nlsolve.results.verdicts import solved
from nlsolve.show.figures import BaseFigure, FigureError, FigureSpec, draw

ADAPTER: TypeAdapter[BaseFigure] = TypeAdapter(FigureSpec)
NOTHING = pd.DataFrame()
INF = np.inf

# Three strategies, four problems; the last problem is solved by nobody, the third by one strategy.
COSTS = np.array([[1.0, 6.0, INF, INF], [2.0, 2.0, INF, INF], [4.0, 8.0, 5.0, INF]])


def test_ratios_to_the_cheapest_of_each_problem() -> None:
    expected = [[1.0, 3.0, INF, INF], [2.0, 1.0, INF, INF], [4.0, 4.0, 1.0, INF]]
    assert ratios(COSTS).tolist() == expected


@pytest.mark.parametrize("wrong", [0.0, -1.0, np.nan])
def test_ratios_need_positive_costs(wrong: float) -> None:
    with pytest.raises(ValueError, match="costs should be positive, and ∞ where a strategy failed"):
        ratios(np.array([[1.0, wrong]]))


def test_a_performance_profile_by_hand() -> None:
    shares = within(ratios(COSTS), np.array([1.0, 2.0, 3.0, 4.0]))
    assert shares.tolist() == [[0.25, 0.25, 0.5, 0.5], [0.25, 0.5, 0.5, 0.5], [0.25, 0.25, 0.25, 0.75]]


def test_a_data_profile_by_hand() -> None:
    shares = within(COSTS, np.array([0.5, 2.0, 5.0, 8.0]))
    assert shares.tolist() == [[0.0, 0.25, 0.25, 0.5], [0.0, 0.5, 0.5, 0.5], [0.0, 0.0, 0.5, 0.75]]


def costs() -> st.SearchStrategy[np.ndarray]:
    entry = st.one_of(st.floats(1e-3, 1e6), st.just(INF))
    shape = st.tuples(st.integers(1, 4), st.integers(1, 6))
    return shape.flatmap(lambda size: arrays(float, size, elements=entry))


@settings(max_examples=60, deadline=None)
@given(costs())
def test_profiles_rise_from_the_wins_to_the_share_solved(cost: np.ndarray) -> None:
    relative = ratios(cost)
    finite = relative[np.isfinite(relative)]
    limits = np.unique(np.r_[1.0, finite, 1e300])
    shares = within(relative, limits)
    assert (np.diff(shares, axis=1) >= 0.0).all()
    np.testing.assert_array_equal(shares[:, -1], np.isfinite(cost).mean(axis=1))
    some = np.isfinite(cost).any(axis=0)
    cheapest = (cost == cost.min(axis=0)) & some
    np.testing.assert_array_equal(shares[:, 0], cheapest.mean(axis=1))
    np.testing.assert_allclose(ratios(7.0 * cost)[np.isfinite(cost)], relative[np.isfinite(cost)], rtol=1e-12)


@settings(max_examples=30, deadline=None)
@given(costs())
def test_bands_rise_and_lie_between_none_and_all(cost: np.ndarray) -> None:
    limits = np.unique(np.r_[1e-4, cost[np.isfinite(cost)]])
    low, high = band(cost, limits, 0.9, 200, 3)
    assert (low >= 0.0).all()
    assert (low <= high).all()
    assert (high <= 1.0).all()
    assert (np.diff(low, axis=1) >= -1e-12).all()
    assert (np.diff(high, axis=1) >= -1e-12).all()
    shares = within(cost, limits)
    sure = (shares == 0.0) | (shares == 1.0)  # no draw can change what all problems or none do
    np.testing.assert_allclose(low[sure], shares[sure], atol=1e-12)
    np.testing.assert_allclose(high[sure], shares[sure], atol=1e-12)


def test_a_band_is_the_binomial_one() -> None:
    """One limit, P problems, 40 % solved: what is drawn anew is binomial, whose quantiles are known."""
    problems = 50
    cost = np.where(np.arange(problems) < 0.4 * problems, 1.0, INF)[None]
    low, high = band(cost, np.array([2.0]), 0.9, 20_000, 0)
    expected = binom.ppf([0.05, 0.95], problems, 0.4) / problems
    np.testing.assert_allclose([low[0, 0], high[0, 0]], expected, atol=1.0 / problems)
    again = band(cost, np.array([2.0]), 0.9, 20_000, 0)
    np.testing.assert_array_equal([low, high], again)
    wide = band(cost, np.array([2.0]), 0.99, 20_000, 0)
    assert wide[0] < low < high < wide[1]


def test_of_a_single_problem_nothing_can_be_drawn_anew() -> None:
    low, high = band(np.array([[3.0], [INF]]), np.array([1.0, 4.0]), 0.9, 100, 0)
    assert low.tolist() == high.tolist() == [[0.0, 1.0], [0.0, 0.0]]


def test_all_strategies_are_given_the_same_draws() -> None:
    cost = np.random.default_rng(1).lognormal(size=12)
    low, high = band(np.stack([cost, cost]), np.array([0.5, 1.0, 2.0]), 0.9, 100, 0)
    np.testing.assert_array_equal(low[0], low[1])
    np.testing.assert_array_equal(high[0], high[1])


def test_wilsons_interval() -> None:
    """Both ends p solve |s/N − p| = z √(p (1 − p)/N). Newcombe's example (1998): 81 of 263, 95 %: 0.2553, 0.3662."""
    np.testing.assert_allclose(wilson(81, 263, 0.95), (0.2553, 0.3662), atol=5e-5)
    for solved_runs, runs in ((0, 5), (3, 5), (5, 5), (17, 20)):
        low, high = wilson(solved_runs, runs, 0.9)
        for end in (low, high):
            if min(end, 1.0 - end) < 1e-12:  # the root at 0 or 1, where nothing can be told from rounding
                continue
            spread = 1.6448536269514722 * np.sqrt(end * (1.0 - end) / runs)
            assert abs(solved_runs / runs - end) == pytest.approx(spread, rel=1e-9)
    assert wilson(0, 5, 0.9)[0] == pytest.approx(0.0, abs=1e-12)
    assert wilson(5, 5, 0.9)[1] == pytest.approx(1.0, abs=1e-12)
    assert wilson(5, 5, 0.9)[0] < 0.7  # five of five are no certainty


# What counts as solved.

RUN = {"status": "converged", "residual_norm": 1e-9, "stop.kind": "residual", "stop.tolerance": 1e-8, "doubt": ""}


@pytest.mark.parametrize(
    ("changes", "expected"),
    [
        ({}, True),
        ({"status": "stagnated"}, False),
        ({"residual_norm": 2e-8}, False),
        ({"residual_norm": np.nan}, False),
        ({"residual_norm": 1e-5, "stop.tolerance": 1e-4}, True),
        ({"residual_norm": 1e-5, "stop.kind": "claim"}, False),  # it says so, and is not
        ({"residual_norm": 1e-7, "stop.kind": "claim"}, True),
        ({"residual_norm": 1e-7, "stop.kind": "difference", "stop.tolerance": 1e-2}, True),
        ({"velocity_error": 0.06}, False),  # wrong, without a word of doubt
        ({"velocity_error": 0.06, "doubt": "too coarse"}, False),  # another root, with a word of doubt
        ({"velocity_error": 0.04, "doubt": "too coarse"}, True),
        ({"velocity_error": np.nan}, True),
    ],
)
def test_solved_is_converged_verified_and_near_what_is_known(changes: dict[str, Any], expected: bool) -> None:
    assert solved(RUN | changes) is expected


def test_what_is_accepted_is_for_the_asker_to_say() -> None:
    assert solved(RUN | {"velocity_error": 0.06}, accepted=0.1)
    assert not solved(RUN | {"torque_error": 0.06}, error="torque_error")


# Figures.


def runs(**columns: Any) -> pd.DataFrame:
    """COSTS as runs: strategies a, b, c; problems law.index x start.seed."""
    rows = [
        {
            "strategy": name,
            "solver.kind": {"a": "newton", "b": "newton", "c": "anm"}[name],
            "solver.order": {"c": 20.0}.get(name, np.nan),
            "law.index": 1.0 if problem < 2 else 0.3,
            "start.seed": problem % 2,
            "scene.kind": "box",
            "status": "converged" if np.isfinite(cost) else "diverged",
            "residual_norm": 1e-9,
            "seconds": cost if np.isfinite(cost) else 0.01,
            "triangular_solves": 10 * cost if np.isfinite(cost) else 1,
            "factorizations": 3,
            "velocity_error": np.nan,
            "doubt": "",
        }
        for name, row in zip("abc", COSTS, strict=True)
        for problem, cost in enumerate(row)
    ]
    return pd.DataFrame(rows).assign(**columns)


def picture(frame: pd.DataFrame | None = None, **spec: Any) -> Figure:
    given = {"name": "solved", "kind": "performance-profile", "group": "strategy", "bootstrap": 50}
    return draw(ADAPTER.validate_python(given | spec), runs() if frame is None else frame, NOTHING, NOTHING)


def stair(line: Line2D) -> list[list[float]]:
    return np.asarray(line.get_xydata(), dtype=float)[:-1].tolist()  # the last point is the edge of the paper


def legend(figure: Figure) -> list[str]:
    return [text.get_text() for each in figure.legends for text in each.get_texts()]


def test_a_performance_profile_keeps_failures_in() -> None:
    figure = picture()
    lines = list(figure.axes[0].lines)
    assert stair(lines[0]) == [[1.0, 0.25], [2.0, 0.25], [3.0, 0.5], [4.0, 0.5]]
    assert stair(lines[2]) == [[1.0, 0.25], [2.0, 0.25], [3.0, 0.25], [4.0, 0.75]]
    assert {line.get_drawstyle() for line in lines} == {"steps-post"}
    assert legend(figure) == ["a (2/4)", "b (2/4)", "c (3/4)"]
    assert figure.axes[0].get_title() == "1 of 4 problems are solved by none"
    assert figure.axes[0].get_xscale() == "log"
    assert figure.axes[0].get_xlabel() == r"$\tau$: time inside the method, over the least of all strategies"
    assert len(figure.axes[0].collections) == 3  # bands


def test_a_data_profile_of_weighted_work() -> None:
    cost = {"triangular_solves": 1.0, "factorizations": 20.0}
    figure = picture(kind="data-profile", cost=cost, bootstrap=0, title="Work")
    assert stair(figure.axes[0].lines[1])[:2] == [[70.0, 0.0], [80.0, 0.5]]
    assert stair(figure.axes[0].lines[2])[-1] == [140.0, 0.75]
    assert figure.axes[0].get_xlabel() == "triangular solves + 20 factorisations"
    assert figure.axes[0].get_title() == "Work, 1 of 4 problems are solved by none"
    assert not figure.axes[0].collections


def test_false_successes_and_unverified_claims_are_failures() -> None:
    wrong = runs(velocity_error=[0.2] + [0.01] * 11)
    assert legend(picture(wrong)) == ["a (1/4)", "b (2/4)", "c (3/4)"]
    assert legend(picture(wrong, accepted=0.3)) == ["a (2/4)", "b (2/4)", "c (3/4)"]
    claimed = runs(residual_norm=[1e-9] * 4 + [1e-3] * 4 + [1e-9] * 4)
    assert legend(picture(claimed)) == ["a (2/4)", "b (0/4)", "c (3/4)"]


def test_problems_are_what_differs_within_a_strategy_or_what_is_said() -> None:
    assert legend(picture(problem=["law.index", "start.seed"])) == ["a (2/4)", "b (2/4)", "c (3/4)"]
    noted = runs(**{"solver.note": range(12)})  # differs, and is not the problem's
    assert legend(picture(noted, problem=["law.index", "start.seed"])) == legend(picture())
    assert legend(picture(where={"law.index": 1.0}))[2] == "c (2/2)"


def test_strategies_of_several_columns() -> None:
    frame = runs()
    frame = frame[frame["strategy"] != "b"]
    assert legend(picture(frame, group=["solver.kind", "solver.order"])) == ["newton (2/4)", "anm, order 20 (3/4)"]


@pytest.mark.parametrize(
    ("spec", "change", "sentence"),
    [
        ({"cost": "second"}, {}, "'second' is not in `runs`; the nearest are seconds"),
        ({"group": "variant"}, {}, "group 'variant' is not in `runs`"),
        ({"problem": "law.indx"}, {}, "'law.indx' is not in `runs`; the nearest are law.index"),
        ({"error": "torque_error"}, {}, "'torque_error' is not in `runs`"),
        ({}, {"status": "diverged"}, "none of the 12 chosen runs solved its problem"),
        ({"problem": "law.index"}, {}, "2 runs of a are of one problem; they differ in start.seed: add one to"),
        (
            {"group": "solver.kind"},
            {},
            "newton has no run of 4 of the 12 problems, such as strategy = c, law.index = 1.0, start.seed = 0: choose",
        ),
        ({}, {"seconds": 0.0}, "a solved run of a has the cost 0, which a logarithmic axis cannot show"),
        ({}, {"seconds": np.nan}, "a solved run of a has the cost nan.*choose other columns than seconds"),
        ({"where": {"law.index": 0.5}}, {}, "no case has law.index = 0.5"),
    ],
)
def test_refusals(spec: dict[str, Any], change: dict[str, Any], sentence: str) -> None:
    with pytest.raises(FigureError, match='^figure "solved": .*' + sentence):
        picture(runs(**change), **spec)


@pytest.mark.parametrize(
    ("spec", "sentence"),
    [
        ({"cost": {}}, "at least 1 item"),
        ({"cost": {"seconds": 0}}, "greater than 0"),
        ({"group": []}, "at least 1 item"),
        ({"interval": 1}, "less than 1"),
        ({"bootstrap": -1}, "greater than or equal to 0"),
        ({"accepted": 0}, "greater than 0"),
    ],
)
def test_declarations_out_of_range(spec: dict[str, Any], sentence: str) -> None:
    with pytest.raises(ValidationError, match=sentence):
        picture(**spec)


def test_a_study_can_check_every_name() -> None:
    given = {"name": "p", "kind": "data-profile", "problem": "law.index", "cost": {"seconds": 1, "residuals": 2}}
    assert ADAPTER.validate_python(given).columns_of_runs() == {
        "where": (),
        "group": ("variant",),
        "problem": ("law.index",),
        "cost": ("seconds", "residuals"),
        "error": ("velocity_error",),
    }


def test_names_of_settings_settle_what_they_assign() -> None:
    """Two sweeps of named settings, each with a column of its own, and a parameter that neither assigns."""
    frame = pd.DataFrame(
        {
            "strategy": ["a", "a", "b", "b"],
            "trial": ["x", "y", "x", "y"],
            "solver.kind": ["newton", "newton", "anm", "anm"],
            "law.index": [1.0, 0.5, 1.0, 0.5],
            "record.times": ["[]", "[]", "[]", "[1.0]"],
        }
    )
    assert differing_parameters(frame) == ["strategy", "trial"]
    assert differing_parameters(pd.concat([frame, frame]).assign(**{"start.seed": [0] * 4 + [1] * 4})) == [
        "strategy",
        "trial",
        "start.seed",
    ]
