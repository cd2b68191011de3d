"""Every table that a shipped study declares is typeset within one column, whatever its cells turn out to be."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from typesetting import ENGINES, needs, typeset

from nlsolve.results.columns import RUNS
from nlsolve.show.tables import Table, built
from nlsolve.study.study import Study

STUDIES = sorted((Path(__file__).parents[3] / "studies").rglob("*.toml"))
WORDS = {"message": "it ended", "lane": "exclusive", "ordering": "colamd", "environment": "abc", "clock": "processor"}
UNITS = ("residual", "expansion", "jacobian", "matrix_product", "factorization", "triangular_solve", "series_order")


def made_up(study: Study) -> pd.DataFrame:
    """A row for each case of a study, its measures drawn over many orders of magnitude; one in nine has diverged."""
    chance = np.random.default_rng(len(study.cases))
    rows = []
    for number, case in enumerate(study.cases):
        measures = {name: 10.0 ** chance.uniform(-5.0, 2.0) for name in RUNS}
        measures |= {name: float(chance.integers(0, 2000)) for name, column in RUNS.items() if counts(column.name)}
        measures |= {f"unit.{name}": 10.0 ** chance.uniform(-5.0, -1.0) for name in (*UNITS, "series_term")}
        status = "diverged" if number % 9 == 8 else "converged"
        of_errors = {name: 10.0 ** chance.uniform(-12.0, -2.0) for name in ("residual_norm", "root_error")}
        texts = {"case": case.id, "status": status, "doubt": "", "start_way": "", "interpreter": ""}
        rows.append({**measures, **of_errors, **WORDS, **texts, **case.parameters})
    frame = pd.DataFrame(rows)
    frame["nodes"] = (
        frame.groupby([name for name in frame if name.startswith("scene.")], dropna=False).ngroup() * 37.0 + 122.0
    )
    return frame


def counts(column: str) -> bool:
    return column in ("tangents", "iterations", "factorizations", "residuals", "increments", "fill", "unknowns") or (
        column.startswith("reported_") or column.endswith(("_solves", "_orders", "_terms", "jacobians", "_iterations"))
    )


def tables_of(path: Path) -> dict[str, Table]:
    study = Study.from_toml(path)
    tables, refused = built(study.tables, made_up(study))
    assert refused == []
    return {f"{path.stem}-{table.spec.name}": table for table in tables}


@pytest.fixture(scope="module")
def texts() -> dict[str, str]:
    """The declared tables of all shipped studies in LaTeX."""
    return {name: table.latex() for path in STUDIES for name, table in tables_of(path).items()}


@pytest.mark.slow
@pytest.mark.parametrize("engine", ENGINES)
def test_every_table_fits_one_column(tmp_path, engine, texts):
    needs(engine)
    assert len(texts) > 60
    assert typeset(tmp_path, texts, engine).stat().st_size > 50_000


def test_the_first_study_is_typeset(tmp_path):
    """The tables of the README, whose headings have a Greek letter and which are wide."""
    needs("pdflatex")
    (path,) = (path for path in STUDIES if path.stem == "first")
    study = Study.from_toml(path)
    known = {
        "tangents": 60,
        "triangular_solves": 620,
        "seconds": 7.002,
        "residual_norm": 9.71e-9,
        "velocity_error": 0.01674,
    }
    tables, _ = built(study.tables, made_up(study).assign(status="converged", **known))
    texts = {f"first-{table.spec.name}": table.latex() for table in tables}
    assert r"tolerance $\eta$" in texts["first-branches"]
    assert texts["first-strategies"].count(r"\toprule") == 1
    assert typeset(tmp_path, texts, "pdflatex").exists()
