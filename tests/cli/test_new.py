"""`nlsolve new`: what is written keeps its contract, its study runs, its test passes, and no file is overwritten."""

from __future__ import annotations

import runpy
import subprocess
import sys
import tomllib
from pathlib import Path
from types import ModuleType

import pytest
from typer.testing import CliRunner

from nlsolve.cli.app import app
from nlsolve.cli.plugins.scaffold import CONTRACTS, files_of
from nlsolve.registry.classes import CONTRACTS as NOUNS
from nlsolve.registry.registry import Registry

LONGEST = {"law": 15, "solver": 40}
"""Lines of a template, blank ones not counted."""


def told(*words: str) -> tuple[int, str, str]:
    result = CliRunner().invoke(app, ["new", *words])
    return result.exit_code, result.stdout, result.stderr


@pytest.mark.parametrize("contract", CONTRACTS)
def test_the_test_that_is_written_passes(contract: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """It holds the plugin to its contract, and runs the study that uses it."""
    code, said, _ = told(contract, "my-own", "--to", str(tmp_path))
    assert code == 0
    assert said.split("\n")[:3] == [str(tmp_path / name) for name in ("my_own.py", "my_own.toml", "test_my_own.py")]
    monkeypatch.syspath_prepend(str(tmp_path))
    try:
        tests = runpy.run_path(str(tmp_path / "test_my_own.py"))
        tests["test_it_keeps_its_contract"]()
        tests["test_its_study_runs"]()
    finally:
        sys.modules.pop("my_own", None)


def test_every_contract_has_a_template() -> None:
    nouns = {"linear-solver": "linear", "system": "scene", "pde": "scene"}
    assert {nouns.get(contract, contract) for contract in CONTRACTS} == set(NOUNS)


@pytest.mark.parametrize("contract", CONTRACTS)
def test_a_package_is_a_plugin(contract: str) -> None:
    """Its module has the hook that the entry point leads to; what else it needs is named."""
    files = files_of(contract, "my-own", package=True)
    project = tomllib.loads(files["my-own/pyproject.toml"])
    assert project["project"]["entry-points"]["nlsolve"] == {"my-own": "my_own"}
    module = ModuleType("my_own")
    sys.modules["my_own"] = module
    try:
        exec(compile(files["my-own/my_own.py"], "my_own.py", "exec"), module.__dict__)
        registry = Registry()
        registry.add(module, "my-own 0.1.0 (my_own)")
    finally:
        del sys.modules["my_own"]
    assert [(row.kind, row.failure) for row in registry.plugins()] == [("my-own", None)]
    assert set(files) == {
        f"my-own/{path}"
        for path in (
            "my_own.py",
            "study.toml",
            "tests/test_my_own.py",
            "pyproject.toml",
            "README.md",
            ".github/workflows/test.yml",
        )
    }
    assert "plugins" not in tomllib.loads(files["my-own/study.toml"])
    assert "${{ matrix.python }}" in files["my-own/.github/workflows/test.yml"]


@pytest.mark.slow
def test_a_package_is_installed_and_found(tmp_path: Path) -> None:
    assert told("solver", "my-own", "--package", "--to", str(tmp_path))[0] == 0
    target, package = tmp_path / "site", tmp_path / "my-own"
    pip = [sys.executable, "-m", "pip", "install", "-q", "--no-deps", "--target", str(target), str(package)]
    subprocess.run(pip, check=True)
    environment = {"PYTHONPATH": str(target), "PATH": "", "OPENBLAS_NUM_THREADS": "1"}
    check = [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", str(package)]
    subprocess.run(check, check=True, env=environment, cwd=package)
    command = "from nlsolve.cli.main import main; main()"
    subprocess.run([sys.executable, "-c", command, "check", "my-own"], check=True, env=environment, cwd=tmp_path)


@pytest.mark.parametrize(("contract", "lines"), LONGEST.items())
def test_a_first_plugin_is_short(contract: str, lines: int) -> None:
    text = files_of(contract, "my-own", package=False)["my_own.py"]
    assert len([line for line in text.splitlines() if line]) <= lines
    assert max(map(len, text.splitlines())) <= 120


def test_no_file_is_overwritten(tmp_path: Path) -> None:
    (tmp_path / "my_own.toml").write_text("mine", encoding="utf-8")
    code, _, said = told("law", "my-own", "--to", str(tmp_path))
    assert code == 2
    path = tmp_path / "my_own.toml"
    assert said == f"{path} is there already, and nothing was written: choose another name or folder\n"
    assert [path.name for path in tmp_path.iterdir()] == ["my_own.toml"]
    assert path.read_text(encoding="utf-8") == "mine"


@pytest.mark.parametrize(
    ("words", "sentence"),
    [
        (("solvr", "my-own"), "solvr: no such contract; did you mean 'solver'?"),
        (("law", "My Own"), "'My Own' cannot be a kind: write small letters, digits and hyphens, such as my-law"),
        (("law", "class"), "'class' cannot be a kind"),
        (("law", "numpy"), "'numpy': there is a module 'numpy' already, which it would hide: choose another name"),
    ],
)
def test_what_cannot_be_written(words: tuple[str, str], sentence: str, tmp_path: Path) -> None:
    code, _, said = told(*words, "--to", str(tmp_path))
    assert code == 2
    assert said.startswith(sentence)
    assert not list(tmp_path.iterdir())
