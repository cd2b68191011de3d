"""Faulty plugins from the command line: exit codes, what is said, and what is tried again."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import planted
import pytest
from fakes import fake_march, registry_of, write_study
from typer.testing import CliRunner

from nlsolve.cli.app import app

STUDY = """\
question = "What does a crash cost?"
scene = { kind = "published", problem = "powell-singular" }
limits = { memory = "2 GiB" }

[[sweep]]
zip = { "solver.kind" = ["newton", "faults", "tells", "loops"], "limits.seconds" = [60, 60, 60, 2] }
"""


SOURCE = Path(planted.__file__).read_text(encoding="utf-8")


def command(folder: Path, *arguments: str, source: str = SOURCE) -> subprocess.CompletedProcess[str]:
    """`nlsolve …` in a process of its own, with the planted plugins installed, or those of another source."""
    packages = folder / "packages"
    (packages / "planted-1.0.dist-info").mkdir(parents=True, exist_ok=True)
    (packages / "planted-1.0.dist-info" / "METADATA").write_text("Metadata-Version: 2.1\nName: planted\nVersion: 1.0\n")
    (packages / "planted-1.0.dist-info" / "entry_points.txt").write_text("[nlsolve]\nplanted = planted\n")
    (packages / "planted.py").write_text(source, encoding="utf-8")
    return subprocess.run(
        [sys.executable, "-c", "from nlsolve.cli.main import main; main()", *arguments],
        cwd=folder,
        env={**os.environ, "PYTHONPATH": str(packages)},
        capture_output=True,
        text=True,
        timeout=300,
    )


def test_a_crash_and_a_hang_cost_their_own_cases(tmp_path):
    (tmp_path / "study.toml").write_text(STUDY)
    first = command(tmp_path, "run", "study.toml", "--jobs", "2")
    assert "Traceback" not in first.stderr
    assert first.returncode == 1
    assert "4 cases: 2 converged, 1 crashed, 1 timed out" in first.stderr.replace(
        "1 timed out, 1 crashed", "1 crashed, 1 timed out"
    )
    assert "the interpreter ended with SIGSEGV at " in first.stderr
    assert "(solver 'faults')" in first.stderr
    assert "limits.seconds = 2 at " in first.stderr
    assert "with --retry 'crashed' --retry 'timed out'" in first.stderr
    again = command(tmp_path, "run", "study.toml")
    assert again.returncode == 1, "what has crashed is not hidden by a second run"
    assert again.stderr.count(" before") == 4
    retried = command(tmp_path, "run", "study.toml", "--retry", "crashed")
    assert retried.stderr.count(" before") == 3


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        (["--retry", "crashd"], "--retry 'crashd': no such status; did you mean 'crashed'?"),
        (["--isolation", "full"], "isolation = 'full': no such isolation; there are 'process', 'none'"),
        (["--jobs", "0"], "jobs = 0: at least one case at a time is run"),
        (["--jobs", "2", "--pdb"], "jobs = 2: without isolation the cases run one after the other"),
        (["--isolation", "process", "--pdb"], "a debugger needs the cases in this process"),
        (["--set", "limits.memory=4"], "limits.memory = 4: should be a number with a unit"),
        (["--set", "limits.seconds=0"], "limits.seconds = 0: should be greater than 0"),
    ],
)
def test_wishes_that_cannot_be_met_are_2(tmp_path, monkeypatch, arguments, sentence):
    monkeypatch.setattr("nlsolve.study.study.load_registry", registry_of)
    monkeypatch.setattr("nlsolve.cli.options.load_registry", registry_of)
    monkeypatch.chdir(tmp_path)
    result = CliRunner().invoke(app, ["run", str(write_study(tmp_path)), *arguments])
    assert result.exit_code == 2
    assert sentence in result.stderr
    assert len(result.stderr.strip().splitlines()) == 1


def test_pdb_is_called_where_the_error_is_raised(tmp_path, monkeypatch):
    monkeypatch.setattr("nlsolve.study.study.load_registry", registry_of)
    monkeypatch.setattr("nlsolve.cli.options.load_registry", registry_of)
    monkeypatch.chdir(tmp_path)
    debugged = []
    monkeypatch.setattr("nlsolve.cli.progress.pdb.post_mortem", debugged.append)

    def march(parts, listen, clock, **way):
        if parts.solver.order == 10:
            raise RuntimeError("[oops]")
        return fake_march(parts, listen)

    monkeypatch.setattr("nlsolve.running.engines.execution.run_case", march)
    result = CliRunner().invoke(app, ["run", str(write_study(tmp_path)), "--pdb"])
    assert result.exit_code == 1
    assert len(debugged) == 2
    assert "RuntimeError: [oops]" in result.stderr


def test_work_in_other_processes_and_values_that_cannot_be_sent_are_told(tmp_path):
    kinds = '["forks", "unsendable"], "limits.seconds" = [60, 60] }'
    text = STUDY.replace('["newton", "faults", "tells", "loops"], "limits.seconds" = [60, 60, 60, 2] }', kinds)
    (tmp_path / "study.toml").write_text(text)
    told = command(tmp_path, "run", "study.toml")
    assert told.returncode == 1
    assert "is in doubt: the case left processes running, whose work is not counted" in told.stderr
    assert "a plugin has put a value into the case's rows that cannot be pickled: Can't pickle local" in told.stderr


def test_a_plugin_that_cannot_be_imported_is_told_by_a_command_that_tries_it(tmp_path):
    (tmp_path / "study.toml").write_text(STUDY[: STUDY.index("[[sweep]]")])
    told = command(tmp_path, "validate", "study.toml", source="raise KeyboardInterrupt")
    assert told.returncode == 0
    reason = "the plugin 'planted' cannot be imported: it raises KeyboardInterrupt"
    assert told.stderr == f"{reason}; --disable-plugin planted spares the attempt\n"
    disabled = command(tmp_path, "validate", "study.toml", "--disable-plugin", "planted", source="1 / 0")
    assert (disabled.returncode, disabled.stderr) == (0, "")
