"""A core for one process, and how much of it others take."""

from __future__ import annotations

import math
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from nlsolve.running.timing import cores
from nlsolve.running.timing.cores import Load, calmest, cores_here, stay_on

pytestmark = pytest.mark.skipif(not cores.CAN_PIN, reason="no process is kept on a core here")


@pytest.fixture
def mine() -> Iterator[frozenset[int]]:
    """The cores of this thread, which are given back."""
    found = cores_here()
    yield found
    stay_on(found)


def test_a_thread_stays_where_it_is_put(mine: frozenset[int]) -> None:
    core = max(mine)
    stay_on(frozenset({core}))
    assert cores_here() == {core}
    code = "import os; print(os.sched_getaffinity(0))"
    told = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout
    assert told.strip() == f"{{{core}}}", "and so does what it starts"


@pytest.mark.parametrize(("used", "core"), [([0.0, 0.0], 1), ([0.0, 5.0], 0), ([90.0, 80.0], 1), ([3.0], 1)], ids=str)
def test_the_calmest_core_is_chosen(monkeypatch: pytest.MonkeyPatch, used: list[float], core: int) -> None:
    monkeypatch.setattr(cores.psutil, "cpu_percent", lambda seconds, percpu: used)
    assert calmest(frozenset({0, 1})) == core


def test_a_core_that_may_not_be_used_is_not_chosen(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(cores.psutil, "cpu_percent", lambda seconds, percpu: [50.0, 0.0, 40.0])
    assert calmest(frozenset({0, 2})) == 2


def test_a_process_on_the_same_core_is_load(mine: frozenset[int]) -> None:
    stay_on(frozenset({max(mine)}))
    with subprocess.Popen(
        [sys.executable, "-c", "print(flush=True)\nwhile True: pass"], stdout=subprocess.PIPE
    ) as other:
        assert other.stdout is not None
        other.stdout.readline()
        load, end = Load(), time.perf_counter() + 0.5
        while time.perf_counter() < end:
            pass
        share = load.share()
        other.kill()
    assert 0.2 < share < 1.0


def test_a_rest_is_no_load() -> None:
    load = Load()
    time.sleep(0.2)
    assert load.share() < 0.2


def test_what_the_system_does_not_count_is_not_known(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(cores, "WAITED", Path("/nowhere"))
    assert math.isnan(Load().share())
    monkeypatch.setattr(cores, "CAN_PIN", False)
    assert cores_here() == frozenset()
