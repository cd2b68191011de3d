"""Strangers' plugins that exit, crash, hang or flood at import: each is a row with its reason, the others work."""

from __future__ import annotations

import importlib.metadata
import json
import os
import subprocess
import sys
from importlib.metadata import EntryPoint
from pathlib import Path

import pytest

from nlsolve.registry.installed import probing
from nlsolve.registry.installed.probing import KNOWN_FAULTS, environment_of_faults, faults_of, undisturbed
from nlsolve.registry.registry import Registry

SOUND = """\
from typing import Literal
from nlsolve.plugin import NonlinearSolver, hookimpl

class Still(NonlinearSolver):
    kind: Literal["still"] = "still"

    def steps(self, problem, tangent, start):
        return iter(())

@hookimpl
def nlsolve_components():
    return [Still]
"""

PLANTED = {
    "a_sound": (SOUND.replace("still", "first"), None),
    "b_exits": ("import os; os._exit(0)", "it ends the interpreter with exit code 0"),
    "c_system_exits": ("import sys; sys.exit(3)", "it raises SystemExit: 3"),
    "d_hangs": ("import time; time.sleep(1000)", "it takes more than 2 s"),
    "e_loops": ("while True: pass", "it takes more than 2 s"),
    "f_floods": ("while True: print('x' * 1000)", "it prints more than 100000 bytes"),
    "g_faults": ("import ctypes; ctypes.string_at(0)", "it ends the interpreter with SIGSEGV"),
    "h_interrupts": ("raise KeyboardInterrupt", "it raises KeyboardInterrupt"),
    "i_raises": ("1 / 0", None),
    "j_moves": ("import os; os.chdir('/'); print('a word')\n" + SOUND, None),
}
"""Source of each plugin, and why it must not be imported."""


@pytest.fixture
def planted(tmp_path, monkeypatch) -> list[EntryPoint]:
    """The entry points of an installed package of all planted plugins."""
    info = tmp_path / "strangers-1.0.dist-info"
    info.mkdir()
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: strangers\nVersion: 1.0\n")
    (info / "entry_points.txt").write_text("[nlsolve]\n" + "".join(f"{name} = {name}\n" for name in PLANTED))
    for name, (source, _) in PLANTED.items():
        (tmp_path / f"{name}.py").write_text(source)
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.setattr(probing, "_found", {})
    monkeypatch.setattr(probing, "IMPORT_SECONDS", 2.0)
    probing._probed.cache_clear()
    return [e for e in importlib.metadata.entry_points(group="nlsolve") if e.dist and e.dist.name == "strangers"]


def test_each_fault_is_a_row_and_the_others_work(planted, monkeypatch, capfd):
    monkeypatch.setattr("nlsolve.registry.installed.entries.entry_points", lambda group: planted)
    folder = Path.cwd()
    registry = Registry.installed()
    assert set(registry.classes("solver")) == {"first", "still"}
    failures = {row.source: row.failure for row in registry.plugins() if row.failure}
    for name, (_, reason) in PLANTED.items():
        if reason is not None:
            told = failures.pop(f"strangers 1.0 ({name})")
            assert told == f"the plugin {name!r} cannot be imported: {reason}"
    assert failures == {
        "strangers 1.0 (i_raises)": "the plugin 'i_raises' cannot be imported: ZeroDivisionError: division by zero"
    }
    assert Path.cwd() == folder
    assert capfd.readouterr().out == "", "standard output is for data"
    assert json.loads(environment_of_faults()[KNOWN_FAULTS]).keys() == {n for n, (_, r) in PLANTED.items() if r}


def test_a_plugin_is_tried_once_a_process_and_in_none_that_was_told(planted, monkeypatch):
    sound = planted[:1]
    assert faults_of(sound) == {}
    monkeypatch.setattr(probing, "_imported", lambda entries: pytest.fail("tried again"))
    assert faults_of(sound) == {}
    monkeypatch.setenv(KNOWN_FAULTS, json.dumps({"d_hangs": "it hangs"}))
    assert faults_of(planted) == {"d_hangs": "it hangs"}


def test_a_process_that_cannot_start_blames_no_plugin(planted, monkeypatch):
    monkeypatch.setattr(probing, "PROGRAM", "raise SystemExit(1)")
    assert faults_of(planted) == {}


def test_without_strangers_nothing_is_tried(monkeypatch):
    monkeypatch.setattr(probing, "_imported", lambda entries: pytest.fail("tried"))
    assert faults_of([]) == {}


def test_a_removed_working_folder_is_no_fault(tmp_path, monkeypatch):
    place = tmp_path / "gone"
    place.mkdir()
    monkeypatch.chdir(place)
    with undisturbed():
        place.rmdir()
        os.chdir(tmp_path)
    assert Path.cwd() == tmp_path


def test_the_list_of_plugins_is_printed_with_exit_code_0(planted, tmp_path):
    """A module that exits when it is imported does not end the program."""
    (tmp_path / "strangers-1.0.dist-info" / "entry_points.txt").write_text("[nlsolve]\na = b_exits\nb = a_sound\n")
    told = subprocess.run(
        [sys.executable, "-c", "from nlsolve.cli.main import main; main()", "plugins", "--json"],
        env={**os.environ, "PYTHONPATH": str(tmp_path)},
        capture_output=True,
        text=True,
        check=True,
    )
    rows = json.loads(told.stdout)
    assert rows[-1]["failure"] == "the plugin 'a' cannot be imported: it ends the interpreter with exit code 0"
    assert "first" in {row["kind"] for row in rows}
