"""The README's promises: its Python prints what is shown, its two commands work, its studies are the shipped ones."""

from __future__ import annotations

import contextlib
import io
import re
import tomllib
from pathlib import Path
from types import ModuleType

import pytest

import nlsolve
from nlsolve.plugin import NonlinearSolver
from nlsolve.registry.registry import Registry
from nlsolve.study.study import Study
from nlsolve.testing import check_solver

ROOT = Path(__file__).parent.parent
README = (ROOT / "README.md").read_text(encoding="utf-8")


BLOCKS = re.findall(r"```python\n(.*?)```(?:\n\n```text\n(.*?)```)?", README, flags=re.DOTALL)
"""Every block of Python, and what it prints where that is shown behind it."""


@pytest.fixture(scope="module")
def session() -> tuple[ModuleType, list[str]]:
    """The blocks, run one after the other like a notebook: their names, and what each has printed."""
    module, printed = ModuleType("readme"), []
    for block, _ in BLOCKS:
        told = io.StringIO()
        with contextlib.redirect_stdout(told):
            exec(compile(block, "README.md", "exec", dont_inherit=True), module.__dict__)
        printed.append(told.getvalue())
    return module, printed


def untimed(text: str) -> list[str]:
    """The lines that are the same on every machine."""
    return [line.rstrip() for line in text.splitlines() if not line.startswith("seconds")]


def test_every_block_prints_what_is_shown(session):
    shown = [text for _, text in BLOCKS]
    assert sum(map(bool, shown)) == 4
    for printed, text in zip(session[1], shown, strict=True):
        assert untimed(printed) == untimed(text)


def test_every_public_name_is_explained():
    table = README[README.index("| from `nlsolve` |") :].split("\n\n")[0]
    assert set(re.findall(r"`(\w+)`", table)) - {"nlsolve"} == set(nlsolve.__all__) - {"__version__"}


def test_the_solver_of_the_readme_keeps_the_contract(session):
    damped = session[0].Damped
    assert issubclass(damped, NonlinearSolver)
    registry = Registry.installed()
    rule = registry.classes("refresh")["every-iteration"]()
    check_solver(damped(length=1.0), rule)


def test_the_study_of_the_readme_is_valid():
    (block,) = [part for part in README.split("\n\n") if part.lstrip().startswith('question = "How many tangents are')]
    text = "\n".join(line.removeprefix("    ") for line in block.splitlines())
    assert len(Study.from_dict(tomllib.loads(text)).cases) == 8


def test_exactly_two_commands_set_up_and_go():
    commands = [line.strip() for line in README.splitlines() if "-m venv" in line]
    assert len(commands) == 2
    assert commands[0].endswith("nlsolve run studies/first.toml")
    assert commands[1].endswith("-m pytest -n logical --dist loadfile")


def test_every_shipped_study_is_listed_with_its_question():
    for path in sorted((ROOT / "studies").rglob("*.toml")):
        study = Study.from_toml(path)
        row = f"| `{path.relative_to(ROOT).as_posix()}` | {study.question} |"
        assert row in README, row
        assert Study.from_toml(path, quick=True).cases, f"{path.name} has no quick cases"
