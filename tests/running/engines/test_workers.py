"""Worker processes: each fault costs its own case, which says what and where; the others are as in one process."""

from __future__ import annotations

import os
import re
import signal
import subprocess
import sys
import time
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path
from typing import Any, ClassVar, Literal

import pandas as pd
import planted
import psutil
import pytest
from planted import OFFERED, Planted

import nlsolve
from nlsolve import Event, Results, Status
from nlsolve.plugin import NonlinearSolver
from nlsolve.registry.problems import StudyError
from nlsolve.results.columns import RUNS, is_timed
from nlsolve.running.engines.processes import process
from nlsolve.running.engines.processes.process import BOOT, END_OF_OUTPUT
from nlsolve.running.runner import run
from nlsolve.running.store.identity import case_of
from nlsolve.running.store.reading import output_file

HANGING = ("loops", "deaf", "stuck")
BY_KIND = {cls.kind_name(): cls for cls in OFFERED}
ENDINGS = {
    "sound": ("converged", None, "the stopping test was met"),
    "loops": ("timed out", None, r"limits.seconds = 5 at FILE:\d+ \(solver 'loops'\)"),
    "deaf": ("timed out", None, r"limits.seconds = 5 at "),
    "stuck": ("timed out", None, r"limits.seconds = 5 at FILE:\d+ \(solver 'stuck'\)"),
    "yields-forever": ("budget spent", None, "the iterations allowed were used up"),
    "leaks": ("out of memory", None, r"at FILE:\d+ \(solver 'leaks'\)"),
    "asks-for-too-much": ("out of memory", None, r"MemoryError: Unable to allocate 72\.8 TiB"),
    "exits": ("crashed", "exit code 3", r"ended with exit code 3 at FILE:\d+ \(solver 'exits'\)"),
    "system-exits": ("crashed", "SystemExit", r"SystemExit: 0 \(FILE:\d+\) in solver 'system-exits'"),
    "interrupts": ("crashed", "KeyboardInterrupt", r"KeyboardInterrupt \(FILE:\d+\) in solver 'interrupts'"),
    "faults": ("crashed", "SIGSEGV", r"ended with SIGSEGV at FILE:\d+ \(solver 'faults'\)"),
    "killed": ("crashed", "SIGKILL", "ended with SIGKILL"),
    "raises": ("crashed", None, r"ZeroDivisionError: by a plugin \(FILE:\d+\) in solver 'raises'"),
    "changes-folder": ("converged", None, ""),
    "floods": ("converged", None, ""),
    "forks": ("converged", None, ""),
    "works-elsewhere": ("converged", None, ""),
    "patches-clocks": ("converged", None, ""),
    "tells": ("converged", None, ""),
    "slow": ("converged", None, ""),
    "unsendable": ("crashed", None, "cannot be pickled: Can't pickle local object"),
}
"""Status, interpreter, and a pattern for the message, for each kind of planted solver."""


def document(*solvers: NonlinearSolver | dict[str, Any], **sections: Any) -> dict[str, Any]:
    """A study of one small system under these solvers."""
    seconds = [5.0 if isinstance(solver, Planted) and solver.kind_name() in HANGING else 120.0 for solver in solvers]
    return {
        "question": "What does a plugin cost?",
        "scene": {"kind": "published", "problem": "powell-singular"},
        "limits": {"memory": "800 MB"},
        "sweep": [{"zip": {"solver": list(solvers), "limits.seconds": seconds}}],
        **sections,
    }


def outputs(results: Results) -> dict[str, str]:
    """What each case has printed, by its solver."""
    assert results.folder is not None
    files = {run["case"]: run["solver.kind"] for _, run in results.runs.iterrows()}
    paths = (results.folder / "cases").glob("*.txt")
    return {files[case_of(path.stem)]: path.read_text(encoding="utf-8") for path in paths}


def workers() -> set[int]:
    """The worker processes there are of this process."""
    return {child.pid for child in psutil.Process().children(recursive=True)}


@pytest.fixture(scope="module")
def everything(tmp_path_factory) -> Results:
    """A study of all planted solvers, two cases at a time."""
    study = document(*(cls() for cls in OFFERED))
    return run(study, tmp_path_factory.mktemp("planted"), isolation="process", jobs=2)


@pytest.mark.parametrize("kind", ENDINGS)
def test_a_fault_is_the_ending_of_its_own_case(everything, kind):
    (row,) = everything.runs[everything.runs["solver.kind"] == kind].to_dict("records")
    status, interpreter, pattern = ENDINGS[kind]
    assert row["status"] == status, row["message"]
    assert (row["interpreter"] if isinstance(row["interpreter"], str) else None) == interpreter
    assert re.search(pattern.replace("FILE", re.escape(planted.__file__)), row["message"])


def test_every_planted_solver_has_an_ending(everything):
    assert set(ENDINGS) == set(BY_KIND) == set(everything.runs["solver.kind"])
    assert everything.notes == ()


def test_what_a_stopped_case_has_done_is_in_its_row(everything):
    runs = everything.runs.set_index("solver.kind")
    assert runs.loc["loops", "residuals"] == 0
    assert runs.loc["loops", "residual_norm"] > 0.0
    assert runs.loc["loops", "unknowns"] == 4
    assert len(everything.steps[everything.steps["case"] == runs.loc["loops", "case"]]) == 1
    assert pd.isna(runs.loc["deaf", "residuals"]), "nothing is left of a case that had to be killed"


def test_all_other_cases_are_as_in_one_process(everything):
    """Row for row, seconds and what was printed aside."""
    sound = [kind for kind, (status, *_) in ENDINGS.items() if status == "converged"]
    sound = [kind for kind in sound if kind not in ("forks", "works-elsewhere", "changes-folder", "patches-clocks")]
    serial = run(document(*(BY_KIND[kind]() for kind in sound)), isolation="none").runs.astype(object)
    compared = [name for name in RUNS if not is_timed(name) and name != "lane"]
    parallel = everything.runs.astype(object).set_index("case").loc[serial["case"]].reset_index()
    same = [frame[compared].where(frame[compared].notna(), None) for frame in (parallel, serial)]
    pd.testing.assert_frame_equal(*same, check_dtype=False)
    changed = everything.runs.set_index("solver.kind").loc[["forks", "works-elsewhere", "changes-folder"]]
    assert set(changed["iterations"]) == set(serial["iterations"])


def test_hidden_work_puts_a_case_in_doubt(everything):
    doubts = everything.runs.set_index("solver.kind")["doubt"]
    assert doubts["forks"] == "the case left processes running, whose work is not counted"
    assert doubts["works-elsewhere"].endswith("s of work were done in other processes and not counted")
    assert not doubts["sound"] or pd.isna(doubts["sound"])


def test_hidden_processes_are_ended(everything):
    hidden = [int(word) for word in outputs(everything)["forks"].split()]
    assert len(hidden) == 2
    assert not [number for number in hidden if psutil.pid_exists(number)]


def test_what_a_case_prints_is_kept_beside_its_row(everything):
    printed = outputs(everything)
    assert set(printed) == {"floods", "forks", "tells"}
    assert printed["floods"].startswith("first line\nxxx")
    assert printed["floods"].endswith("xxx\nlast line\n")
    assert " bytes left out " in printed["floods"]
    assert 2 * END_OF_OUTPUT < len(printed["floods"]) < 2 * END_OF_OUTPUT + 100


def test_a_worker_serves_until_a_case_has_changed_it(tmp_path):
    solvers = [
        planted.Tells(number=1),
        planted.Tells(number=2),
        planted.ChangesFolder(),
        planted.Tells(number=3),
        planted.PatchesClocks(),
        planted.Tells(number=4),
    ]
    results = run(document(*solvers), tmp_path, isolation="process", jobs=1)
    told = {}
    for _, row in results.runs[results.runs["solver.kind"] == "tells"].iterrows():
        file = output_file(tmp_path, row["case"])
        assert file is not None
        lines = file.read_text().splitlines()
        told[row["solver.number"]] = lines[0].split()
    numbers = [told[number][0] for number in (1, 2, 3, 4)]
    assert numbers[0] == numbers[1]
    assert len(set(numbers)) == 3
    assert {tuple(words[1:]) for words in told.values()} == {(os.getcwd(), "True", "1")}
    assert str(os.getpid()) not in numbers
    assert (results.runs["seconds"] > 0.0).all(), "a clock that a plugin has patched times nothing"


def test_a_resumed_study_does_not_die_again(everything, tmp_path):
    study, folder = document(*(cls() for cls in OFFERED)), everything.folder
    events: list[Event] = []
    run(study, folder, isolation="process", jobs=2, listen=events.append)
    again = {event.case.parameters["solver.kind"] for event in events if event.run is not None and not event.resumed}
    assert again == {"raises", "unsendable"}, "errors that cost nothing, and may be gone"
    events.clear()
    run(study, folder, isolation="process", jobs=2, listen=events.append, retry=[Status.OUT_OF_MEMORY])
    again = {event.case.parameters["solver.kind"] for event in events if event.run is not None and not event.resumed}
    assert again == {"raises", "unsendable", "leaks", "asks-for-too-much"}


def test_a_raised_limit_is_a_reason_to_try_again(tmp_path):
    """The limit is no part of what a case is, unless it is swept."""
    study = {**document(planted.Loops()), "sweep": [], "solver": planted.Loops()}
    resumed = []
    for seconds in (0.5, 0.5, 1.0):
        changed = {"limits": {"seconds": seconds}}
        events: list[Event] = []
        run({**study, **changed}, tmp_path, isolation="process", listen=events.append)
        resumed.append(events[-1].resumed)
    assert resumed == [False, True, False]


class OfThisScript(NonlinearSolver):
    """As a class of a script that calls `nlsolve.run`."""

    kind: Literal["of-this-script"] = "of-this-script"
    processes: ClassVar[list[int]] = []

    def steps(self, problem: Any, tangent: Any, start: Any) -> Any:
        self.processes.append(os.getpid())
        return planted.Sound().steps(problem, tangent, start)


def test_components_of_the_running_script_run_in_its_process(monkeypatch):
    monkeypatch.setattr(OfThisScript, "__module__", "__main__")
    results = run(document({"kind": "newton"}, OfThisScript()), isolation="process", jobs=2)
    assert results.runs["status"].tolist() == ["converged"] * 2
    assert OfThisScript.processes == [os.getpid()]
    assert results.notes == (
        "solver 'of-this-script' cannot go to another process (OfThisScript is defined in the script that runs): its "
        "cases were run in this process, one after the other and without limits",
    )


def test_components_that_a_worker_cannot_import_run_here(monkeypatch):
    """Here the module of the class is one that only this process has."""
    module = type(sys)("only_here")
    module.OfThisScript = OfThisScript  # type: ignore[attr-defined]
    monkeypatch.setitem(sys.modules, "only_here", module)
    monkeypatch.setattr(OfThisScript, "__module__", "only_here")
    OfThisScript.processes.clear()
    results = run(document(OfThisScript()), isolation="process")
    assert OfThisScript.processes == [os.getpid()]
    (note,) = results.notes
    assert "the section 'solver' cannot be imported by another process (ModuleNotFoundError" in note


def test_a_plugin_of_one_file_goes_along(tmp_path):
    """Its module has a name under which nobody finds it."""
    source = Path(planted.__file__).read_text(encoding="utf-8")
    (tmp_path / "mine.py").write_text(source.replace('"tells"', '"mine"'))
    spec = spec_from_file_location("a_file_of_mine", tmp_path / "mine.py")
    assert spec is not None
    assert spec.loader is not None
    module = sys.modules[spec.name] = module_from_spec(spec)
    spec.loader.exec_module(module)
    results = run(document(module.Tells()), tmp_path / "out", isolation="process")
    del sys.modules[spec.name]
    assert results.notes == ()
    assert not outputs(results)["mine"].startswith(str(os.getpid()))


def test_an_interruption_stops_all_workers_and_keeps_what_is_finished(tmp_path):
    study = document({"kind": "newton"}, planted.Sound(), planted.Loops(), planted.Tells())
    before = workers()

    def interrupt(event: Event) -> None:
        if event.run is not None and event.case.parameters["solver.kind"] == "sound":
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        run(study, tmp_path, isolation="process", jobs=2, listen=interrupt)
    assert workers() == before
    kept = pd.read_parquet(tmp_path / "runs.parquet")
    assert "sound" in set(kept["solver.kind"])


def test_a_killed_runner_takes_its_workers_along(tmp_path):
    study = tmp_path / "script.py"
    study.write_text(
        "import sys\n"
        f"sys.path.insert(0, {str(Path(planted.__file__).parent)!r})\n"
        "import nlsolve, planted\n"
        "nlsolve.run({'question': '?', 'scene': {'kind': 'published', 'problem': 'powell-singular'},\n"
        "             'solver': planted.Loops()},\n"
        "            isolation='process', listen=lambda event: print('begun', flush=True))\n"
    )
    with subprocess.Popen([sys.executable, str(study)], stdout=subprocess.PIPE, text=True) as runner:
        assert runner.stdout is not None
        assert runner.stdout.readline() == "begun\n"
        family = psutil.Process(runner.pid)
        while not (found := family.children(recursive=True)):
            time.sleep(0.05)
        runner.send_signal(signal.SIGKILL)
        runner.wait()
    gone, alive = psutil.wait_procs(found, timeout=30)
    assert len(gone) == 1
    assert alive == []


def test_a_killed_worker_costs_no_case(tmp_path):
    before = workers()
    killed: set[int] = set()

    def kill(event: Event) -> None:
        """While the second case runs."""
        if not killed and event.number == 2:
            killed.update(workers() - before)
            os.kill(min(killed), signal.SIGKILL)

    slow = [planted.Slow(number=number) for number in range(4)]
    results = run(document(*slow), tmp_path, isolation="process", jobs=1, listen=kill)
    assert len(killed) == 1
    assert results.runs["status"].tolist() == ["converged"] * 4


def test_wishes_that_do_not_go_together():
    study = document(planted.Sound())
    with pytest.raises(StudyError, match="isolation = 'proces': no such isolation; did you mean 'process'"):
        run(study, isolation="proces")
    with pytest.raises(StudyError, match="jobs = 0: at least one case at a time"):
        run(study, jobs=0)
    with pytest.raises(StudyError, match="jobs = 2: without isolation the cases run one after the other"):
        run(study, isolation="none", jobs=2)
    with pytest.raises(StudyError, match="a debugger needs the cases in this process"):
        run(study, isolation="process", debugger=print)


def test_a_worker_that_does_not_start_is_a_sentence(monkeypatch):
    monkeypatch.setattr(process, "BOOT", "raise SystemExit('no memory for Python')")
    assert BOOT != process.BOOT
    with pytest.raises(nlsolve.InputError, match=r"no worker process can be started \(no memory for Python\): run the"):
        run(document(planted.Sound()), isolation="process")


def test_an_exit_is_a_row_in_one_process_too():
    """There a KeyboardInterrupt is the user's."""
    results = run(document(planted.SystemExits()), isolation="none")
    assert results.runs["interpreter"].tolist() == ["SystemExit"]
    with pytest.raises(KeyboardInterrupt):
        run(document(planted.Interrupts()), isolation="none")


def test_a_debugger_sees_the_error():
    seen: list[BaseException] = []
    results = run(document(planted.Raises()), debugger=seen.append)
    assert results.runs["status"].tolist() == ["crashed"]
    assert [type(error) for error in seen] == [ZeroDivisionError]
