"""Runs killed at any moment, and two runs at once, on this machine and on a cluster: one whole row a case."""

from __future__ import annotations

import json
import subprocess
import sys
import time
from pathlib import Path

import pandas as pd
import psutil
import pytest

from nlsolve.running.store.claims import CLAIMS

CASES, KILLS, JOBS = 40, 10, 2

PLUGIN = """
import time
from typing import Literal
from nlsolve.plugin import NonlinearSolver, Step

class Noting(NonlinearSolver):
    kind: Literal["noting"] = "noting"
    number: int = 0

    def steps(self, problem, tangent, start):
        with open("begun", "a") as file:
            print(self.number, file=file)
        time.sleep(0.1)
        state = start
        while True:
            yield Step(state)
            tangent.refresh_if_due(lambda: problem.jacobian(state))
            state = state - tangent.solve(problem.residual(state))
"""

STUDY = f"""\
question = "Does every case have one row?"
plugins = ["./noting.py"]
scene = {{ kind = "published", problem = "powell-singular" }}
solver = {{ kind = "noting" }}

[[sweep]]
grid = {{ "solver.number" = {{ range = [1, {CASES}, 1] }} }}
"""

pytestmark = [pytest.mark.slow, pytest.mark.parametrize("engine", ["local", "dask"])]


class Place:
    """A folder with a study whose cases note in a file that they have begun."""

    def __init__(self, folder: Path, engine: str) -> None:
        self.folder, self.out = folder, folder / "out"
        main = "from nlsolve.cli.main import main; main()"
        options = ["--engine", engine, "--jobs", str(JOBS), "--out", "out"]
        self.command = [sys.executable, "-c", main, "run", "study.toml", *options]
        (folder / "noting.py").write_text(PLUGIN, encoding="utf-8")
        (folder / "study.toml").write_text(STUDY, encoding="utf-8")

    def start(self) -> subprocess.Popen[str]:
        return subprocess.Popen(
            self.command, cwd=self.folder, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
        )

    def begun(self) -> list[int]:
        """The numbers of the cases that have begun, each as often as it has."""
        path = self.folder / "begun"
        return [int(line) for line in path.read_text(encoding="utf-8").split()] if path.exists() else []

    def finish(self, *runs: subprocess.Popen[str]) -> None:
        """The runs end well, with one part a case, each complete; nothing is left of claims and half-written files."""
        for run, (table, said) in [(run, run.communicate(timeout=600)) for run in runs]:
            assert run.returncode == 0, said
            assert table.count("converged") == CASES
        parts = sorted(path.name.partition("-")[0] for path in (self.out / "cases").glob("*.json"))
        assert len(parts) == len(set(parts)) == CASES
        runs = pd.read_parquet(self.out / "runs.parquet")
        assert sorted(runs["case"]) == parts
        assert sorted(runs["solver.number"]) == list(range(1, CASES + 1))
        assert set(pd.read_parquet(self.out / "steps.parquet")["case"]) == set(parts)
        assert len(pd.read_csv(self.out / "runs.csv")) == CASES
        assert list((self.out / CLAIMS).iterdir()) == []


@pytest.fixture
def place(tmp_path: Path, engine: str) -> Place:
    return Place(tmp_path, engine)


def test_a_run_killed_at_ten_moments_loses_what_was_running_only(place):
    for number in range(KILLS):
        before, run = len(place.begun()), place.start()
        while len(place.begun()) < before + JOBS + 1:
            assert run.poll() is None, run.communicate()
            time.sleep(0.01)
        time.sleep(0.013 * number)
        every = psutil.Process(run.pid).children(recursive=True)
        workers = [child for child in every if child.name() != "uname"]  # which tells of the environment
        run.kill()
        run.communicate()
        assert len(workers) == JOBS
        _, alive = psutil.wait_procs(workers, timeout=10)
        assert alive == []
        for path in (place.out / "cases").glob("[!.]*"):
            rows = json.loads(path.read_text(encoding="utf-8")) if path.suffix == ".json" else pd.read_parquet(path)
            assert len(rows), "no file is torn"
    place.finish(place.start())
    assert set(place.begun()) == set(range(1, CASES + 1))
    assert len(place.begun()) <= CASES + JOBS * KILLS


def test_two_runs_on_one_folder_compute_each_case_once(place):
    place.finish(place.start(), place.start())
    assert sorted(place.begun()) == list(range(1, CASES + 1))
