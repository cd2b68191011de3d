"""What a notebook shows of a solve."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from nlsolve.contracts.outcome import Outcome
from nlsolve.contracts.status import Status

ROWS = ({"step": 0, "residual_norm": 1.0}, {"step": 1, "residual_norm": 1e-9, "length": 1.0})


def outcome(**changes) -> Outcome:
    made = Outcome(
        Status.CONVERGED,
        Status.CONVERGED.sentence,
        np.array([1.0, -0.25]),
        1e-9,
        ROWS,
        counts={"factorizations": 1, "residuals": 2, "series_orders": 0},
        seconds={"factorization": 0.002, "residual": 0.001, "series_order": 0.0, "own": 0.0005},
    )
    return dataclasses.replace(made, **changes)


def test_it_prints_what_one_wants_to_know():
    assert repr(outcome()).splitlines() == [
        "status      converged: the stopping test was met",
        "residual    1e-09",
        "iterations  1",
        "work        1 factorization, 2 residuals",
        "seconds     0.0035: factorization 0.002, residual 0.001, own 0.0005",
        "state       1, -0.25 (2 unknowns)",
    ]


def test_a_failure_says_why_and_a_long_state_shows_its_ends():
    failed = outcome(
        status=Status.SINGULAR_TANGENT, detail="SuperLU: a pivot vanished", state=np.arange(9.0), counts={}, seconds={}
    )
    lines = repr(failed).splitlines()
    assert lines[0] == f"status      singular tangent: {Status.SINGULAR_TANGENT.sentence}; SuperLU: a pivot vanished"
    assert lines[3:] == ["work        none", "seconds     0", "state       0, 1, 2, …, 6, 7, 8 (9 unknowns)"]


def test_steps_are_a_frame():
    frame = outcome().steps
    assert list(frame.columns) == ["step", "residual_norm", "length"]
    assert frame["residual_norm"].tolist() == [1.0, 1e-9]
    assert len(outcome(rows=()).steps) == 0
    assert (outcome().iterations, outcome(rows=()).iterations) == (1, 0)


def test_a_solution_is_one_at_whichever_root():
    assert outcome().converged
    assert outcome(status=Status.OTHER_ROOT).converged
    assert not outcome(status=Status.DIVERGED).converged


def test_it_is_frozen():
    with pytest.raises(dataclasses.FrozenInstanceError):
        outcome().residual_norm = 0.0  # type: ignore[misc]
