"""Predictors: exact on polynomials in time, bounded amplification, and what they leave of the first residual."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from cases import setup
from nlsolve_rules.predictors import Polynomial, Previous
from nlsolve_rules.refresh import PoorContraction
from nlsolve_scenes import StirringTool
from nlsolve_scenes.nodes.rings import Rings
from nlsolve_solvers.modified_newton import ModifiedNewton
from pydantic import ValidationError
from scipy.special import binom

from nlsolve.plugin import NodeMotion, Physics, Predictor, TimeSteps
from nlsolve.solving.simulate import Record
from nlsolve.solving.simulate import run_case as march
from nlsolve.solving.stopping import StoppingTest
from nlsolve.testing import check_predictor

PREDICTORS = (Previous(), Polynomial(), Polynomial(degree=4))
DT = 1e-4


@pytest.mark.parametrize("predictor", PREDICTORS, ids=repr)
def test_predictors_conform(predictor: Predictor) -> None:
    check_predictor(predictor)


def weights(d: int) -> np.ndarray:
    """c_i, read off the guess from unit velocities."""
    past = [np.full((1, 2), 0.0) for _ in range(d + 1)]
    return np.array(
        [Polynomial(degree=d).guess([v + (i == k) for k, v in enumerate(past)])[0, 0] for i in range(d + 1)]
    )


@pytest.mark.parametrize("d", [1, 2, 3, 5])
def test_a_polynomial_goes_on_by_backward_differences(d: int) -> None:
    """c_i = (−1)ⁱ C(d+1, i+1); exact for a motion of degree d in time, wrong by its difference d + 1 for the next."""
    i = np.arange(d + 1)
    np.testing.assert_allclose(weights(d), (-1.0) ** i * binom(d + 1, i + 1), rtol=1e-9)
    for degree, missed in ((d, 0.0), (d + 1, float(np.prod(np.arange(1, d + 2))))):
        past = [np.full((3, 2), (-float(k)) ** degree) for k in range(d + 1)]
        np.testing.assert_allclose(1.0 - Polynomial(degree=d).guess(past), missed, atol=1e-8)


def test_the_first_degree_is_twice_the_last_velocity_less_the_one_before() -> None:
    v = np.random.default_rng(0).standard_normal((2, 5, 2))
    np.testing.assert_allclose(Polynomial(degree=1).guess(list(v)), 2.0 * v[0] - v[1], atol=1e-14)


def test_at_the_start_of_a_march_the_degree_is_what_the_past_allows() -> None:
    past = [np.full((3, 2), 7.0 - 2.0 * k) for k in range(3)]  # 3, 5, 7 and on to 9
    assert Polynomial(degree=3).guess(past[:1]) == pytest.approx(7.0)
    for known in (2, 3):
        assert Polynomial(degree=3).guess(past[:known]) == pytest.approx(9.0)


@pytest.mark.parametrize(("d", "size"), [(1, 2.2), (2, 4.4), (3, 8.3)])
def test_the_amplification_told_in_the_docstring(d: int, size: float) -> None:
    assert np.linalg.norm(weights(d)) == pytest.approx(size, abs=0.05)


# In the march.


def marched(predictor: Predictor, motion: NodeMotion, inertia: bool = False) -> Record:
    parts: dict[str, Any] = {
        "physics": Physics(inertia=inertia),
        "time": TimeSteps(horizon=8 * DT, increment=DT),
        "motion": motion,
        "solver": ModifiedNewton(),
        "refresh": PoorContraction(),
        "stop": StoppingTest(tolerance=1e-10),
    }
    return march(setup(StirringTool(nodes=Rings(spacing=0.5)), 0.3, predictor=predictor, **parts))


def first_residuals(record: Record) -> np.ndarray:
    """‖R‖/scale at the beginning of each increment."""
    return record.steps.query("step == 0")["residual_norm"].to_numpy(dtype=float)


@pytest.mark.parametrize(("shifting", "inertia"), [(0.0, False), (0.1, False), (0.0, True)])
def test_a_better_guess_leaves_less_to_do_and_changes_nothing_in_the_result(shifting: float, inertia: bool) -> None:
    """Each degree leaves a smaller first residual, once it is known well enough, where neighbours are kept (`skin`)."""
    motion = NodeMotion(nodes="lagrangian", skin=0.5, shifting=shifting)
    records = [marched(predictor, motion, inertia) for predictor in (Previous(), Polynomial(), Polynomial(degree=2))]
    first = [first_residuals(record) for record in records]
    assert first[0][0] == pytest.approx(first[1][0])  # one velocity is known
    assert first[1][1] == pytest.approx(first[2][1])  # two are
    assert first[0][1:].min() > 7.0 * first[1][1:].max()
    assert first[1][2:].min() > 2.0 * first[2][2:].max()
    solves = [record.summary["triangular_solves"] for record in records]
    assert solves[2] < solves[1] < solves[0]
    errors = [record.summary["velocity_error"] for record in records]
    assert max(errors) - min(errors) < 1e-7


def test_a_steady_flow_on_fixed_nodes_is_predicted_to_the_solution_whatever_the_degree() -> None:
    record = marched(Polynomial(degree=3), NodeMotion(nodes="fixed"))
    assert record.summary["factorizations"] == 0
    assert (first_residuals(record) <= 1e-10).all()


@pytest.mark.parametrize(("component", "fields"), [(Polynomial, {"degree": 0}), (Previous, {"degree": 1})])
def test_nonsense_is_refused(component: type[Any], fields: dict[str, Any]) -> None:
    with pytest.raises(ValidationError, match=next(iter(fields))):
        component(**fields)
