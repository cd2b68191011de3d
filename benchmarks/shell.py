"""How long do the commands around the cases take, where there are thousands of cases?

    python benchmarks/shell.py [cases] [repeats]

Makes a study of that many tiny cases, and a results folder in which all of them are finished: one case is run, and the
others are given its numbers. Prints for every command the least processor time [s] of the repeats, its largest resident
memory [MiB], and what it must stay below. The second run has nothing to do; the first one has to show what is finished,
and leaves the modules of nlsolve compiled, as an installation does.
"""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
from collections.abc import Mapping
from pathlib import Path

import nlsolve
from nlsolve.results.frames import Part
from nlsolve.running.store.store import Store

STUDY = """question = "How long does the shell take?"

[scene]
kind = "published"
problem = "powell-singular"

[solver]
kind = "newton"

[[sweep]]
grid = {{ stop.tolerance = {{ logspace = [1e-12, 1e-3, {tolerances}] }} }}

[[sweep]]
grid = {{ budget.iterations = {{ range = [1, {budgets}, 1] }} }}

[[table]]
name = "work"
rows = "stop.tolerance"
columns = "budget.iterations"
value = "iterations"
"""

BUDGETS = 100
"""Values of the second parameter; of the first there are as many as the number of cases asks for."""

LIMITS: Mapping[str, tuple[int, float, float]] = {
    "validate": (10_000, 5.0, 1024.0),
    "plan": (10_000, 5.0, 1024.0),
    "status": (10_000, 5.0, 1024.0),
    "table": (10_000, 5.0, 1024.0),
    "run": (1_000, 2.0, 1024.0),
}
"""Command -> the number of cases up to which it takes at most so many seconds and MiB."""


def finish(study: nlsolve.Study, folder: Path) -> None:
    """Fill a results folder with a part of every case, all with the numbers of the first."""
    first = nlsolve.run(STUDY_OF_ONE, isolation="none")
    (row,) = first.runs.to_dict("records")
    store = Store(folder, study)
    for case in study.cases:
        store.save(case, Part({**row, "case": case.id, **case.parameters}, first.steps, first.fields))


STUDY_OF_ONE = {
    "question": "What are the numbers?",
    "scene": {"kind": "published", "problem": "powell-singular"},
    "solver": {"kind": "newton"},
}


def measured(command: list[str]) -> tuple[float, float]:
    """Processor time [s] and largest resident memory [MiB] of a command. Ends this program where the command fails."""
    keep = {name: value for name, value in os.environ.items() if name != "PYTHONDONTWRITEBYTECODE"}
    with tempfile.TemporaryFile() as output:
        process = subprocess.Popen(command, stdout=output, stderr=output, env={**keep, "OPENBLAS_NUM_THREADS": "1"})
        _, status, used = os.wait4(process.pid, 0)
        process.returncode = os.waitstatus_to_exitcode(status)
        if process.returncode:
            output.seek(0)
            raise SystemExit(output.read().decode())
    return used.ru_utime + used.ru_stime, used.ru_maxrss / 1024


def main() -> None:
    """Print what each command takes."""
    cases = int(sys.argv[1]) if len(sys.argv) > 1 else 10_000
    repeats = int(sys.argv[2]) if len(sys.argv) > 2 else 3
    program = str(Path(sys.executable).with_name("nlsolve"))
    with tempfile.TemporaryDirectory() as place:
        path, folder = Path(place) / "shell.toml", Path(place) / "finished"
        tolerances = -(-cases // BUDGETS)
        path.write_text(STUDY.format(tolerances=tolerances, budgets=BUDGETS), encoding="utf-8")
        study = nlsolve.Study.from_toml(path)
        finish(study, folder)
        commands = {
            "validate": [str(path)],
            "plan": [str(path), "--out", str(folder)],
            "status": [str(folder)],
            "table": [str(folder)],
            "run": [str(path), "--out", str(folder)],
        }
        print(f"{len(study.cases)} cases, best of {repeats}")
        for name, arguments in {"run once": commands["run"], **commands}.items():
            once = name not in commands
            command = [program, name.split()[0], *arguments]
            found = [measured(command) for _ in range(1 if once else repeats)]
            seconds, memory = (min(values) for values in zip(*found, strict=True))
            most, limit, largest = LIMITS.get(name, (0, 0.0, 0.0))
            told = f"  (at most {limit:g} s and {largest:g} MiB)" if len(study.cases) <= most else ""
            print(f"{name:10} {seconds:6.2f} s  {memory:6.0f} MiB{told}", flush=True)


if __name__ == "__main__":
    main()
