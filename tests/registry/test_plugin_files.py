"""Plugins of one file: what they offer, when they are imported, and what is said of a file that cannot be used."""

from __future__ import annotations

import pickle
import sys
from pathlib import Path

import pytest
from fakes import Newton, registry_of

from nlsolve.registry.installed import probing
from nlsolve.registry.installed.entries import installed_plugins
from nlsolve.registry.plugin_files import load_file, with_files
from nlsolve.registry.problems import StudyError
from nlsolve.registry.registry import DISABLE, Registry, load_registry

HALF = '''\
from __future__ import annotations

from typing import Any, Literal

from nlsolve.plugin import ConstitutiveLaw, NonlinearSolver, Step, System


class Base(NonlinearSolver):
    """Without a kind, so it is not offered."""

    length: float = 0.5

    def steps(self, problem: Any, tangent: Any, start: Any) -> Any:
        while True:
            yield Step(start)
            tangent.refresh_if_due(lambda: problem.jacobian(start))
            start = start - self.length * tangent.solve(problem.residual(start))


class Half(Base):
    kind: Literal["half"] = "half"


class Full(Base):
    kind: Literal["newton"] = "newton"
    length: float = 1.0


class Thin(ConstitutiveLaw):
    kind: Literal["thin"] = "thin"

    def viscosity(self, rate_squared: Any) -> Any:
        return 1.0 + 0.0 * rate_squared


Same = Half
'''

HOOK = "\n\nfrom nlsolve.plugin import hookimpl\n\n\n@hookimpl\ndef nlsolve_components():\n    return [Half]\n"


def written(folder: Path, text: str = HALF, name: str = "my_solver.py") -> Path:
    path = folder / name
    path.write_text(text, encoding="utf-8")
    return path


def test_every_class_with_a_kind_is_offered(tmp_path):
    registry = with_files(registry_of(), [written(tmp_path)])
    assert registry.classes("solver").keys() == {"anm", "half"}  # newton is offered twice
    assert list(registry.classes("law")) == ["honey", "thin"]
    assert registry.class_called("solver", "my_solver:newton").__name__ == "Full"
    assert registry.class_called("solver", "fakes:newton") is Newton
    assert registry.files == (tmp_path / "my_solver.py",)
    row = next(row for row in registry.plugins() if row.kind == "half")
    assert row.source == f"my_solver ({tmp_path / 'my_solver.py'})"


def test_a_hook_says_what_is_offered(tmp_path):
    registry = with_files(Registry(), [written(tmp_path, HALF + HOOK)])
    assert list(registry.classes("solver")) == ["half"]
    assert list(registry.classes("law")) == []


def test_a_file_is_imported_once_until_it_is_edited(tmp_path):
    path = written(tmp_path)
    first, again = load_file(path), load_file(path)
    assert first is again
    edited = load_file(written(tmp_path, HALF.replace("0.5", "0.25")))
    assert edited is not first
    assert edited.Half().length == 0.25
    registry = with_files(with_files(Registry(), [path]), [path, path])
    assert registry.files == (path,)


def test_objects_of_its_classes_can_be_sent(tmp_path):
    half = load_file(written(tmp_path)).Half(length=0.3)
    assert pickle.loads(pickle.dumps(half)) == half


@pytest.mark.parametrize(
    ("text", "name", "sentence"),
    [
        (None, "absent.py", "cannot be read: No such file or directory"),
        ("", "empty.py", "cannot be registered: TypeError: it defines no component class with a kind"),
        ("import nothing_of_this_name", "a.py", "cannot be imported: ModuleNotFoundError: No module named 'nothing_"),
        ("def f(:", "b.py", "cannot be imported: SyntaxError: invalid syntax"),
        ("import sys\nsys.exit(0)", "c.py", "cannot be imported: it raises SystemExit: 0"),
        ("raise KeyboardInterrupt", "f.py", "cannot be imported: it raises KeyboardInterrupt"),
        ("import os\nos._exit(0)", "g.py", "cannot be imported: it ends the interpreter with exit code 0"),
        ("import ctypes\nctypes.string_at(0)", "h.py", "cannot be imported: it ends the interpreter with SIGSEGV"),
        ("while True: pass", "i.py", "cannot be imported: it takes more than 1 s"),
        (HALF, "solver.txt", "is no Python file: its name should end with .py"),
        (HALF.replace('"half"', '"a:b"'), "d.py", "TypeError: Half has the kind 'a:b'"),
        (HALF + "\n\ndef nlsolve_components():\n    raise OSError('no licence')\n", "e.py", "OSError: no licence"),
    ],
)
def test_a_file_that_cannot_be_used(tmp_path, monkeypatch, text, name, sentence):
    monkeypatch.setattr(probing, "IMPORT_SECONDS", 1.0)
    path = tmp_path / name if text is None else written(tmp_path, text, name)
    with pytest.raises(StudyError) as caught:
        with_files(Registry(), [path])
    assert str(caught.value).startswith(f"the plugin {path} ")
    assert sentence in str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_file_that_failed_leaves_no_module(tmp_path):
    before = set(sys.modules)
    with pytest.raises(StudyError, match="cannot be imported"):
        load_file(written(tmp_path, "raise ValueError"))
    assert {name for name in set(sys.modules) - before if name.startswith("nlsolve_file")} == set()


@pytest.mark.parametrize(("name", "left"), [("systems", 6), ("nlsolve", 0)])
def test_a_disabled_plugin_is_not_imported(monkeypatch, name, left):
    monkeypatch.setenv(DISABLE, f"{name},not-installed-here")
    registry = load_registry()
    assert registry is load_registry()
    disabled = [row for row in registry.plugins() if row.failure == "disabled"]
    assert len(installed_plugins()) - len(disabled) == left
    assert ("bratu" in registry.classes("scene")) is False
    complaint = registry.complaint("scene", "bratu")
    assert complaint is not None
    assert complaint.endswith(f"; {len(disabled)} plugin(s) disabled")


def test_what_a_file_prints_is_no_data(tmp_path, capfd):
    with_files(Registry(), [written(tmp_path, HALF + "\nprint('hello')\n")])
    told = capfd.readouterr()
    assert (told.out, told.err) == ("", "hello\n")


def test_a_process_that_runs_cases_does_not_try_a_file_again(tmp_path, monkeypatch):
    monkeypatch.setattr(probing, "_imported", lambda entries: pytest.fail("tried"))
    monkeypatch.setenv(probing.KNOWN_FAULTS, "{}")
    assert "half" in with_files(Registry(), [written(tmp_path, HALF + "# another text\n")]).classes("solver")
