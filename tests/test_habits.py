"""What a newcomer relies on: the hooks of CI's linters, the project's citation, and commands and files that exist."""

from __future__ import annotations

import re
import tomllib
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
HOOKS = (ROOT / ".pre-commit-config.yaml").read_text(encoding="utf-8")
CITATION = (ROOT / "CITATION.cff").read_text(encoding="utf-8")
CONTRIBUTING = (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8")
CI = (ROOT / ".ci" / "run").read_text(encoding="utf-8")


def commands_of_ci() -> list[str]:
    """The commands of .ci/run after its tests, without the folder of the virtual environment."""
    return [line.removeprefix(".venv/bin/") for line in CI.splitlines() if line.startswith(".venv/bin/")]


def linters_of_ci() -> list[str]:
    """Those before the site of the documentation is built."""
    return [command for command in commands_of_ci() if not command.startswith("python ")]


def value_of(key: str) -> str:
    """The value of a key at the top of CITATION.cff."""
    (value,) = re.findall(rf"^{key}: (.+)$", CITATION, flags=re.MULTILINE)
    return value


def test_the_hooks_are_the_linters_of_ci():
    assert re.findall(r"^ +entry: (.+)$", HOOKS, flags=re.MULTILINE) == linters_of_ci()
    assert len(linters_of_ci()) == 3


def test_the_hooks_download_nothing():
    assert re.findall(r"repo: (.+)", HOOKS) == ["local"]
    assert set(re.findall(r"language: (.+)", HOOKS)) == {"system"}


@pytest.mark.parametrize(
    ("key", "value"),
    [("cff-version", "1.2.0"), ("type", "software"), ("version", PROJECT["version"]), ("license", PROJECT["license"])],
)
def test_the_citation_is_the_projects(key, value):
    assert value_of(key) == value


def test_the_citation_refers_to_the_paper():
    bibliography = (ROOT / "docs" / "references.bib").read_text(encoding="utf-8")
    (doi,) = re.findall(r"^    doi: (.+)$", CITATION, flags=re.MULTILINE)
    assert f"  doi = {{{doi}}},\n}}" in bibliography[bibliography.index("@article{timesli2015,") :]


@pytest.mark.parametrize("path", [".pre-commit-config.yaml", "CITATION.cff"])
def test_the_yaml_can_be_read(path):
    yaml = pytest.importorskip("yaml")
    assert isinstance(yaml.safe_load((ROOT / path).read_text(encoding="utf-8")), dict)


def test_contributing_names_each_command_of_ci():
    assert len(commands_of_ci()) == 5
    for command in commands_of_ci():
        assert f"\n.venv/bin/{command}\n" in CONTRIBUTING


def test_files_that_contributing_names_are_there():
    named = set(re.findall(r"`((?:[\w.-]+/)*[\w-]*\.(?:py|md|toml|bib|yaml|cff))`", CONTRIBUTING))
    missing = {name for name in named if not (ROOT / name).exists()}
    assert len(named) > 8
    assert missing == {"plugins/nlsolve_laws/my_law.py"}  # the one to be written
