"""The README's promises: its solver works, its two commands are there, its studies are the shipped ones."""

from __future__ import annotations

import re
from pathlib import Path
from types import ModuleType

from pages import blocks

import nlsolve
from nlsolve.plugin import NonlinearSolver
from nlsolve.registry.registry import Registry
from nlsolve.study.study import Study
from nlsolve.testing import check_solver

ROOT = Path(__file__).parent.parent
README = (ROOT / "README.md").read_text(encoding="utf-8")


def test_every_public_name_is_explained():
    table = README[README.index("| from `nlsolve` |") :].split("\n\n")[0]
    assert set(re.findall(r"`(\w+)`", table)) - {"nlsolve"} == set(nlsolve.__all__) - {"__version__"}


def test_the_solver_of_the_readme_keeps_the_contract():
    (block,) = [block for block in blocks(README, "README.md") if "class Damped" in block.text]
    module = ModuleType("readme")
    exec(compile(block.text, block.place, "exec", dont_inherit=True), module.__dict__)
    assert issubclass(module.Damped, NonlinearSolver)
    rule = Registry.installed().classes("refresh")["every-iteration"]()
    check_solver(module.Damped(length=1.0), rule)


def test_the_readme_shows_what_its_blocks_print():
    """tests/docs/test_blocks.py compares it."""
    assert sum(block.shown is not None for block in blocks(README, "README.md")) == 4


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
