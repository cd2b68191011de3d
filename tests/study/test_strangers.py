"""A stranger's scene, neither flow nor system: its own section, one solve, a table, a plan, a diagnosis."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any, ClassVar, Literal

import numpy as np
import pytest
import scipy.sparse as sp
from fakes import Plugin, write_study
from pydantic import Field
from typer.testing import CliRunner

import nlsolve
from nlsolve.cli.app import app
from nlsolve.plugin import (
    Component,
    Entry,
    Expansion,
    Misfit,
    NonlinearProblem,
    Scene,
    Section,
    Series,
    SingleSolve,
    SolveError,
    Status,
    System,
)
from nlsolve.registry.problems import StudyError
from nlsolve.registry.registry import Registry
from nlsolve.results.columns import DIAGNOSTICS
from nlsolve.running.diagnose import diagnose
from nlsolve.running.forecast import forecast
from nlsolve.study.study import Study
from nlsolve.testing import check_problem


class Wire(Component):
    """What the rod is made of: a section of its own, which is no contract of plugins."""

    noun: ClassVar[str] = "wire"
    loss: float = Field(0.5, ge=0, description="b")
    cells: int = Field(20, gt=1, description="U")


class Radiation(NonlinearProblem):
    """A u + b u⁴ = f on the unit interval, with the f that has the root u = 1 + sin πx."""

    def __init__(self, wire: Wire) -> None:
        x = np.linspace(0.0, 1.0, wire.cells)
        second = sp.diags_array([-1.0, 2.5, -1.0], offsets=[-1, 0, 1], shape=(wire.cells, wire.cells))
        self.matrix, self.loss = sp.csr_array(second), wire.loss
        self.root = 1.0 + np.sin(np.pi * x)
        self.force = self.matrix @ self.root + self.loss * self.root**4

    def residual(self, u: Any) -> Any:
        return self.matrix @ u + self.loss * u**4 - self.force

    def jacobian(self, u: np.ndarray) -> Any:
        return (self.matrix + sp.diags_array(4.0 * self.loss * u**3)).tocsr()

    def expand(self, u: np.ndarray) -> Expansion:
        path = Series(u)
        return Expansion(path, self.residual(path))


class Rod(Scene):
    """A rod that radiates, from u = `warmth`."""

    kind: Literal["rod"] = "rod"
    sections: ClassVar[Mapping[str, Section]] = {"wire": Section(Wire, {"cells": 12})}
    warmth: float = Field(1.0, gt=0, description="of the start")

    def check(self, parts: Any) -> None:
        if parts.wire.cells > 1000:
            raise Misfit("wire", "cells", "a rod has 1000 cells at most")

    def simulation(self, parts: Any, entry: Entry) -> SingleSolve:
        with entry("operators"):
            problem = Radiation(parts.wire)

        def measure(u: np.ndarray) -> dict[str, float]:
            return {"root_error": float(np.linalg.norm(u - problem.root) / np.linalg.norm(problem.root))}

        return SingleSolve(problem, np.full(parts.wire.cells, self.warmth), measure)


class Circle(System):
    """A system beside it, which has no such section."""

    kind: Literal["circle"] = "circle"

    def formula(self, u: Any) -> Any:
        x, y = u
        return np.stack([x**2 + y**2 - 1.0, x - y])

    def standard_start(self) -> np.ndarray:
        return np.array([1.0, 0.5])


STUDY = """\
question = "How many iterations does a loss take?"

[scene]
kind = "rod"

[wire]
loss = 2.0

[solver]
kind = "newton"

[stop]
tolerance = 1e-9

[[sweep]]
grid = { "wire.loss" = [0.0, 1.0], "solver.kind" = ["newton", "anm"] }

[[table]]
name = "iterations"
rows = "wire.loss"
columns = "solver.kind"
value = ["iterations", "root_error"]

[quick]
"wire.cells" = 5
"""


@pytest.fixture
def registry() -> Registry:
    found = Registry.installed()
    found.add(Plugin(Rod, Circle), "stranger 1.0")
    return found


@pytest.fixture
def shell(registry: Registry, monkeypatch: pytest.MonkeyPatch) -> Any:
    """The command line, for which the stranger is installed."""
    monkeypatch.setattr("nlsolve.cli.options.load_registry", lambda: registry)
    return lambda *arguments: CliRunner().invoke(app, [str(argument) for argument in arguments])


def test_the_problem_keeps_the_contract() -> None:
    problem = Radiation(Wire())
    check_problem(problem, 0.9 * problem.root)


def test_a_section_of_ones_own_comes_from_the_study(registry: Registry, tmp_path: Path) -> None:
    cases = Study.from_toml(write_study(tmp_path, text=STUDY), registry=registry).cases
    assert [case.parts.wire for case in cases[::2]] == [Wire(loss=0.0, cells=12), Wire(loss=1.0, cells=12)]
    assert cases[0].parameters["wire.cells"] == 12  # the scene's own default
    assert cases[0].label == "wire.loss = 0.0, solver.kind = newton"
    assert len({case.id for case in cases}) == 4
    assert not any(name.startswith(("law.", "time.", "start.")) for name in cases[0].parameters)
    document = {"question": "?", "scene": Rod(), "solver": {"kind": "newton"}}
    (case,) = Study.from_dict(document | {"wire": Wire(cells=7)}, registry=registry).cases
    assert case.parts.wire == Wire(cells=7)
    (case,) = Study.from_dict(document, registry=registry).cases
    assert case.parts.wire == Wire(cells=12)


def test_a_single_solve_runs_in_a_study_with_a_table(registry: Registry, tmp_path: Path) -> None:
    study = Study.from_toml(write_study(tmp_path, text=STUDY), registry=registry)
    results = nlsolve.run(study, tmp_path / "out")
    runs = results.runs
    assert runs["status"].tolist() == ["converged"] * 4, runs["message"].tolist()
    assert runs["unknowns"].tolist() == [12] * 4
    assert (runs["root_error"] < 1e-8).all()
    assert runs["start_factorizations"].isna().all()  # there is no way to a first state
    assert (results.steps.groupby("case")["accepted"].sum() == 1).all()
    assert results.notes == ()
    assert results.fields.groupby("case").size().tolist() == results.runs["unknowns"].tolist()
    table = results.table("iterations")
    assert table.shape == (2, 4)
    assert table.notna().all(axis=None)
    newton = runs[runs["solver.kind"] == "newton"]
    assert newton["iterations"].iloc[0] == 1  # linear without a loss
    assert newton["iterations"].iloc[1] > 1
    assert (tmp_path / "out" / "tables" / "iterations.md").exists()
    assert nlsolve.run(study, tmp_path / "out").runs["seconds"].tolist() == runs["seconds"].tolist()


@pytest.mark.parametrize(
    ("change", "options", "told"),
    [
        (("loss = 2.0", "cells = 1"), {}, "line 7: wire.cells = 1: should be greater than 1"),
        (("loss = 2.0", "los = 2.0"), {}, "line 7: wire.los = 2.0: no such field; did you mean 'loss'?"),
        (('"wire.loss" =', '"wire.lss" ='), {}, "line 16: wire.lss = 0.0: no such field; did you mean 'loss'?"),
        (('"wire.loss" =', '"wir.loss" ='), {}, "line 16: wir.loss = []: not a parameter; did you mean 'wire'?"),
        (("[wire]", "[wre]"), {}, "line 6: wre = {'loss': 2.0}: no such section; did you mean 'wire'?"),
        (("loss = 2.0", "cells = 2000"), {}, "line 7: wire.cells = 2000: a rod has 1000 cells at most"),
        (('"wire.loss" = [0.0,', '"wire.cells" = [2000,'), {}, "line 16: wire.cells = 2000: a rod has 1000 cells"),
        (("= 5", "= 2000"), {"quick": True}, "line 25: wire.cells = 2000: a rod has 1000 cells at most"),
        (("= 5", "= 6"), {"overrides": {"wire.cells": 2000}}, "--set: wire.cells = 2000: a rod has 1000 cells"),
        (('"rod"', '"circle"'), {}, "line 6: wire: the scene 'circle' has no such section: leave it out"),
        (("[solver]", "[law]\nindex = 1.0\n[solver]"), {}, "line 9: law: the scene 'rod' has no such section"),
    ],
)
def test_what_is_wrong_is_told_with_file_and_line(
    registry: Registry, tmp_path: Path, change: tuple[str, str], options: dict[str, Any], told: str
) -> None:
    path = write_study(tmp_path, change, text=STUDY)
    with pytest.raises(StudyError) as caught:
        Study.from_toml(path, registry=registry, **options)
    assert f"{path}, {told}" in str(caught.value)


def test_a_plan_and_a_diagnosis(registry: Registry, tmp_path: Path) -> None:
    study = Study.from_toml(write_study(tmp_path, text=STUDY), registry=registry)
    plan = forecast(study)
    assert plan["unknowns"].tolist() == [12] * 4
    assert plan["increments"].tolist() == [1] * 4
    assert plan["nodes"].isna().all()
    assert (plan["seconds"] > 0.0).all()
    assert (plan["seconds_start"] == 0.0).all()
    rows = diagnose(study)
    assert list(rows.columns) == ["nodes", *DIAGNOSTICS]
    assert rows["operator"].tolist() == ["this scene has no cloud, and no operators on it"]
    assert rows["nodes"].isna().all()


def test_the_command_line_knows_it(shell: Any, tmp_path: Path) -> None:
    path = write_study(tmp_path, text=STUDY)
    plan = shell("plan", path, "--json")
    assert plan.exit_code == 0, plan.stderr
    assert [row["unknowns"] for row in json.loads(plan.stdout)["cases"]] == [12] * 4
    shown = shell("plan", path)
    assert shown.exit_code == 0, shown.stderr
    assert "4 cases" in shown.stdout
    rows = shell("diagnose", path, "--json")
    assert rows.exit_code == 0, rows.stderr
    assert [row["operator"] for row in json.loads(rows.stdout)] == ["this scene has no cloud, and no operators on it"]
    result = shell("run", path, "--quick", "--json", "--out", tmp_path / "out")
    assert result.exit_code == 0, result.stderr
    assert {row["unknowns"] for row in json.loads(result.stdout)["runs"]} == {5}


class Broken(Rod):
    """A rod whose mesh cannot be made."""

    kind: Literal["broken"] = "broken"  # type: ignore[assignment]

    def simulation(self, parts: Any, entry: Entry) -> SingleSolve:
        raise SolveError(Status.BAD_CLOUD, "the rod has a hole")


def test_a_simulation_that_cannot_be_built_is_a_row_a_plan_and_a_diagnosis_with_its_sentence() -> None:
    study = Study.from_dict({"question": "Why not?", "scene": Broken(), "solver": {"kind": "newton"}})
    row = nlsolve.run(study).runs.iloc[0]
    assert row["status"] == "bad cloud"
    assert row["message"].endswith("the rod has a hole")
    assert forecast(study)["seconds"].isna().all()
    assert diagnose(study)["operator"].tolist() == ["the rod has a hole"]
