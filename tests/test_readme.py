"""The README's promises: its solver works as printed, its two commands are there, its studies are the shipped ones."""

from __future__ import annotations

import re
import tomllib
from pathlib import Path
from types import ModuleType

from nlsolve.plugin import NonlinearSolver
from nlsolve.registry.registry import Registry
from nlsolve.study.study import Study
from nlsolve.testing import check_solver

ROOT = Path(__file__).parent.parent
README = (ROOT / "README.md").read_text(encoding="utf-8")


def plugin_of_the_readme() -> ModuleType:
    (block,) = re.findall(r"```python\n(.*?)```", README, flags=re.DOTALL)
    module = ModuleType("damped")
    exec(compile(block, "README.md", "exec", dont_inherit=True), module.__dict__)
    return module


def test_the_solver_of_the_readme_keeps_the_contract():
    damped = plugin_of_the_readme().Damped
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
    assert commands[1].endswith("-m pytest")


def test_every_shipped_study_is_listed_with_its_question():
    for path in sorted((ROOT / "studies").rglob("*.toml")):
        study = Study.from_toml(path)
        row = f"| `{path.relative_to(ROOT).as_posix()}` | {study.question} |"
        assert row in README, row
        assert Study.from_toml(path, quick=True).cases, f"{path.name} has no quick cases"
