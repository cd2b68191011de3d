"""Solved means solved; the long form of this is benchmarks/verdicts.py."""

from __future__ import annotations

from collections import Counter

import numpy as np
import pytest
from nlsolve_systems import Published
from verdicts import EXACT, RIGHT, Rescaled, Run, distance, polished, runs

from nlsolve import Status


def test_no_success_is_false_and_every_method_has_some() -> None:
    found = list(runs(part=0.02))
    verdicts = Counter(run.verdict for run in found)
    assert verdicts["false success"] == 0, [run for run in found if run.verdict == "false success"]
    assert verdicts["right"] > 0.4 * len(found)


@pytest.mark.slow
def test_nor_is_one_of_many() -> None:
    assert [run for run in runs(part=0.5) if run.verdict == "false success"] == []


@pytest.mark.parametrize(
    ("word", "doubt", "distance", "verdict"),
    [
        (Status.CONVERGED.word, "", RIGHT, "right"),
        (Status.OTHER_ROOT.word, "", 2 * RIGHT, "false success"),
        (Status.CONVERGED.word, "no root is near", 1.0, "honest"),
        (Status.CONVERGED.word, "no root is near", 0.0, "false alarm"),
        (Status.STAGNATED.word, "", EXACT, "false alarm"),
        (Status.STAGNATED.word, "", 2 * EXACT, "honest"),
    ],
)
def test_a_verdict_is_by_the_distance_from_a_root(word: str, doubt: str, distance: float, verdict: str) -> None:
    assert Run("?", "newton", word, doubt, distance, EXACT).verdict == verdict


def test_a_root_is_found_without_the_list_of_roots() -> None:
    system = Published(problem="helical-valley")
    found = polished(system, np.array([1.001, 0.002, -0.001]))
    assert found is not None
    np.testing.assert_allclose(found, [1.0, 0.0, 0.0], atol=1e-12)


def test_where_f_is_flat_without_a_zero_there_is_none() -> None:
    system = Published(problem="gulf")
    assert polished(system, np.array([1e30, 1.0, 1.0])) is None


def test_a_distance_is_the_same_in_any_unit() -> None:
    plain, rescaled = (Rescaled(member=0, units=units) for units in (0, 5))
    columns = rescaled.powers()[1]
    u = 1.001 * np.asarray(plain.system.start())
    assert distance(rescaled, columns * u) == pytest.approx(distance(plain, u))
