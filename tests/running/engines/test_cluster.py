"""Cases on a cluster of dask.distributed: rows as in one process, limits kept, lost workers survived."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from collections.abc import Iterator
from typing import Any

import pandas as pd
import planted
import psutil
import pytest
from distributed import Client, LocalCluster
from distributed.scheduler import KilledWorker

import nlsolve
from nlsolve import Event
from nlsolve.registry.problems import StudyError
from nlsolve.results.columns import is_timed
from nlsolve.results.costs.lanes import SHARED
from nlsolve.running.engines import choice, cluster
from nlsolve.running.engines.processes.travel import Unreadable, packed
from nlsolve.running.runner import run
from nlsolve.study.study import Study
from nlsolve.study.timing import Timing

METHODS = ["newton", "modified-newton", "anderson", "broyden", "picard", "robust", "anm"]


def document(*solvers: Any, **limits: Any) -> dict[str, Any]:
    """A study of one small system under these solvers."""
    return {
        "question": "Is it the same elsewhere?",
        "scene": {"kind": "published", "problem": "powell-singular"},
        "limits": {"memory": "800 MB", **limits},
        "sweep": [{"grid": {"solver": list(solvers)}}],
    }


def without_seconds(frame: pd.DataFrame) -> pd.DataFrame:
    """The rows without what a clock has measured."""
    measured = [name for name in frame if is_timed(name) or name in ("lane", "seconds_predicted")]
    return frame.drop(columns=measured).reset_index(drop=True)


@pytest.fixture(scope="module")
def hosts() -> Iterator[LocalCluster]:
    """A cluster of two processes with a thread each, which are replaced when they die."""
    with LocalCluster(n_workers=2, threads_per_worker=1, processes=True, dashboard_address="127.0.0.1:0") as found:
        yield found


def test_a_study_is_the_same_on_a_cluster_of_this_machine(tmp_path):
    """Row for row, seconds aside; and nothing is left of the cluster."""
    study = document(*({"kind": kind} for kind in METHODS))
    before = set(psutil.Process().children(recursive=True))
    found = run(study, tmp_path, engine="dask", jobs=2)
    serial = run(study, isolation="none")
    pd.testing.assert_frame_equal(without_seconds(found.runs), without_seconds(serial.runs))
    pd.testing.assert_frame_equal(without_seconds(found.steps), without_seconds(serial.steps))
    assert found.notes == ()
    assert set(psutil.Process().children(recursive=True)) == before


def test_a_lost_worker_costs_no_case(hosts, tmp_path):
    """It is killed while both have a case."""
    study = document(*(planted.Slow(number=number) for number in range(5)))
    killed: list[int] = []
    rows: list[str] = []

    def kill(event: Event) -> None:
        if event.run is not None:
            rows.append(event.case.id)
        if not killed and event.run is not None:
            with Client(hosts.scheduler_address, set_as_default=False) as client:
                killed.extend(sorted(client.run(os.getpid).values()))
            os.kill(killed[0], signal.SIGKILL)

    found = run(study, tmp_path, engine="dask", scheduler=hosts.scheduler_address, listen=kill)
    assert len(killed) == 2
    assert len(rows) == len(set(rows)) == 5
    pd.testing.assert_frame_equal(without_seconds(found.runs), without_seconds(run(study, isolation="none").runs))


def test_cases_have_their_limits_there_and_faults_are_rows(hosts):
    study = document(planted.Loops(), planted.Exits(), planted.Sound(), seconds=5)
    found = run(study, engine="dask", scheduler=hosts.scheduler_address).runs.set_index("solver.kind")
    assert found["status"].to_dict() == {"loops": "timed out", "exits": "crashed", "sound": "converged"}
    assert "limits.seconds = 5 at " in found.loc["loops", "message"]
    assert found.loc["exits", "interpreter"] == "exit code 3"


def test_an_interruption_stops_what_runs_there():
    before = set(psutil.Process().children(recursive=True))

    def interrupt(event: Event) -> None:
        if event.run is not None:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        run(document(planted.Sound(), planted.Loops()), engine="dask", jobs=2, listen=interrupt)
    _, alive = psutil.wait_procs(set(psutil.Process().children(recursive=True)) - before, timeout=10)
    assert alive == []


SCHEDULER = """
import time
from distributed import LocalCluster
where = {"host": "127.0.0.1", "protocol": "tcp", "dashboard_address": "127.0.0.1:0"}
print(LocalCluster(n_workers=1, threads_per_worker=2, processes=False, **where).scheduler_address, flush=True)
time.sleep(300)
"""


@pytest.mark.slow
def test_a_scheduler_that_is_gone_ends_the_run_with_a_sentence(tmp_path):
    with subprocess.Popen([sys.executable, "-c", SCHEDULER], stdout=subprocess.PIPE, text=True) as there:
        assert there.stdout is not None
        address = there.stdout.readline().strip()

        def kill(event: Event) -> None:
            if event.run is not None:
                there.kill()

        with pytest.raises(
            nlsolve.InputError, match="the scheduler of the cluster is gone: the finished cases are kept"
        ):
            run(document(planted.Sound(), planted.Loops()), tmp_path, engine="dask", scheduler=address, listen=kill)
    assert nlsolve.load(tmp_path).runs["solver.kind"].tolist() == ["sound"]


def test_a_cluster_with_other_source_is_refused(monkeypatch):
    monkeypatch.setattr(cluster, "code_of", lambda sections: {"nlsolve": "other"})
    with pytest.raises(
        nlsolve.InputError, match=r"cannot run case \w+ \(nlsolve is \w+ there and other here\): nlsolve"
    ):
        run(document(planted.Sound()), engine="dask", jobs=1)


class Ended:
    """A future that has ended."""

    def __init__(self, status: str, found: Any) -> None:
        self.status, self.found = status, found

    def result(self) -> Any:
        if isinstance(self.found, Exception):
            raise self.found
        return self.found


def test_what_a_cluster_lacks_is_a_sentence_and_no_row():
    study = Study.from_dict(document({"kind": "newton"}))
    task = packed(study.cases[0], Timing(), SHARED)

    def ending(status: str, found: Any = None) -> Any:
        return cluster._ending(task, Ended(status, found))  # type: ignore[arg-type]

    assert "the scheduler of the cluster is gone" in str(ending("cancelled"))
    assert "(ModuleNotFoundError: No module named 'x'): nlsolve, the plugins" in str(
        ending("error", ModuleNotFoundError("No module named 'x'"))
    )
    assert "(no such plugin): nlsolve" in str(ending("finished", Unreadable("no such plugin")))
    refused = nlsolve.InputError("no worker process can be started")
    assert ending("error", refused) is refused
    lost = ending("error", KilledWorker("task", None, 3)).run
    assert (lost["status"], lost["interpreter"]) == ("crashed", "lost worker")


def test_wishes_that_do_not_go_together(monkeypatch):
    study = document(planted.Sound())
    with pytest.raises(StudyError, match="engine = 'dsk': no such engine; did you mean 'dask'"):
        run(study, engine="dsk")
    with pytest.raises(StudyError, match="only the engine 'dask' has one"):
        run(study, scheduler="tcp://127.0.0.1:8786")
    with pytest.raises(StudyError, match="runs each case in a worker process: drop it, or isolation and debugger"):
        run(study, engine="dask", isolation="none")
    monkeypatch.setattr(cluster, "SECONDS_TO_CONNECT", 0.5)
    for address in ("tcp://127.0.0.1:9", "nowhere://x"):
        with pytest.raises(StudyError, match=f"scheduler = '{address}': no scheduler of dask answers there"):
            run(study, engine="dask", scheduler=address)
    monkeypatch.setattr(choice, "find_spec", lambda name: None)
    with pytest.raises(StudyError, match=r"needs dask.distributed: pip install 'nlsolve\[dask\]', or use 'local'"):
        run(study, engine="dask")
