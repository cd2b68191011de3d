"""The examples run as they stand, are short, and use what is public only."""

from __future__ import annotations

import ast
import runpy
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

import nlsolve
from nlsolve.registry.registry import Registry
from nlsolve.running.diagnose import NO_CLOUD, diagnose
from nlsolve.running.forecast import forecast
from nlsolve.testing import check_law, check_problem

EXAMPLES = Path(__file__).parent.parent / "examples"
SCRIPTS = sorted(EXAMPLES.glob("*.py"))
MOST_LINES = {"p_laplace_by_scikit_fem": 120}  # a discretisation of one's own; all others are shorter
PUBLIC = {"nlsolve", "nlsolve.plugin", "nlsolve.testing"}


@pytest.mark.parametrize("path", SCRIPTS, ids=lambda path: path.stem)
def test_an_example_is_short_and_uses_public_names(path):
    text = path.read_text(encoding="utf-8")
    assert len(text.splitlines()) < MOST_LINES.get(path.stem, 40)
    for node in ast.walk(ast.parse(text)):
        names = [alias.name for alias in node.names] if isinstance(node, ast.Import) else []
        names += [node.module or ""] if isinstance(node, ast.ImportFrom) else []
        assert {name for name in names if name.split(".")[0] == "nlsolve"} <= PUBLIC


def test_the_law_keeps_its_contract_and_prints_its_viscosity(capsys):
    module = runpy.run_path(str(EXAMPLES / "law_in_one_file.py"), run_name="__main__")
    printed = capsys.readouterr().out
    assert printed.splitlines()[0].split()[:1] == ["μ"]
    check_law(module["Ellis"]())
    assert module["Ellis"]().viscosity(np.array([1.0])) == pytest.approx(50.0, rel=1e-15)


def test_the_law_is_a_plugin():
    module = ModuleType("law_in_one_file")
    module.__dict__.update(runpy.run_path(str(EXAMPLES / "law_in_one_file.py")))
    registry = Registry()
    registry.add(module, "example 1.0")
    assert list(registry.classes("law")) == ["ellis"]


def test_the_study_prints_its_table(capsys):
    results = runpy.run_path(str(EXAMPLES / "study_in_python.py"))["results"]
    assert (results.runs["status"] == "converged").all()
    table = results.table("work")
    assert table.loc["newton", "powell-singular"] > table.loc["modified-newton", "powell-singular"] > 0
    assert "the stopping test was met" in capsys.readouterr().out


def test_the_frames_read_with_pandas_hold_each_residual(capsys):
    frames = runpy.run_path(str(EXAMPLES / "results_in_pandas.py"))
    assert len(frames["runs"]) == 4
    last = frames["residuals"].groupby("scene.strength")["residual_norm"].last()
    assert (last < 1e-7).all()
    assert "3.5" in capsys.readouterr().out


class TestPLaplace:
    """A stranger's partial differential equation, assembled by scikit-fem, takes part in all there is."""

    module = runpy.run_path(str(EXAMPLES / "p_laplace_by_scikit_fem.py"))

    def scene(self, **fields):
        return self.module["PLaplace"](**fields)

    def test_its_problem_keeps_the_contract(self):
        problem = self.module["Disc"](self.scene(refinements=2))
        check_problem(problem, 0.9 * problem.exact())

    def test_five_strategies_solve_it_and_its_error_falls_by_four(self):
        results = nlsolve.run(self.module["STUDY"])
        runs = results.runs
        assert len(runs) == 15
        assert (runs["status"] == "converged").all()
        assert (runs["residual_norm"] <= 1e-8).all()
        for _, rows in runs.groupby("solver.kind"):
            coarse, middle, fine = rows.sort_values("scene.refinements")["measured.error"]
            assert 3.5 < coarse / middle < 5.0
            assert 3.5 < middle / fine < 5.0
        tangents = runs.groupby("solver.kind")["tangents"].max()
        assert tangents["modified-newton"] == tangents["anderson"] == 1 < tangents["anm"] < tangents["newton"]
        table = results.table("strategies")
        assert table["measured.error"].notna().all()

    def test_it_is_planned_timed_and_crossed_over(self):
        document = {
            **self.module["STUDY"],
            "scene": self.scene(refinements=3),
            "sweep": [
                {"grid": {"solver.kind": ["newton", "anderson"]}},
                {"grid": {"linear.kind": ["superlu", "lapack"]}},
            ],
            "timing": {"calibrate": True},
            "table": [
                {
                    "name": "lines",
                    "crossover": {"strategy": "solver.kind", "size": "unknowns", "backend": "linear.kind"},
                }
            ],
        }
        study = nlsolve.Study.from_dict(document)
        plan = forecast(study)
        assert (plan["unknowns"] == 113).all()
        assert (plan["seconds"] > 0.0).all()
        cells = nlsolve.run(study).table("lines")
        assert len(cells) == 3  # a row a linear solver, and one for all
        assert list(diagnose(study)["operator"]) == [NO_CLOUD]
