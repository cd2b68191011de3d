"""Statuses: a word in a frame and the value it stands for."""

from __future__ import annotations

import pytest

from nlsolve.contracts.status import Status


@pytest.mark.parametrize("status", Status)
def test_the_word_of_a_status_is_turned_back_into_it(status: Status) -> None:
    assert Status.of(status.word) is status


@pytest.mark.parametrize("word", ["", "CONVERGED", "budget_spent", "the stopping test was met", float("nan"), None])
def test_what_is_no_word_of_a_status_is_refused_with_those_there_are(word: str) -> None:
    with pytest.raises(ValueError, match=r"is no status: there are converged, other root, budget spent, "):
        Status.of(word)
