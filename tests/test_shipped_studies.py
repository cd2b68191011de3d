"""Every shipped study, shrunk by its own [quick] section: it runs, its tables are full, its figures are drawn."""

from __future__ import annotations

from pathlib import Path

import pytest

import nlsolve

STUDIES = Path(__file__).parent.parent / "studies"


@pytest.mark.parametrize("path", sorted(STUDIES.rglob("*.toml")), ids=lambda path: path.stem)
def test_runs_and_shows_what_it_declares(path, tmp_path):
    results = nlsolve.run(path, tmp_path, quick=True)
    assert results.notes == ()
    # Extremes are there to break; all others converge.
    lacking = results.runs["status"] == "not applicable"  # a library that is not installed
    assert set(results.runs["solver.kind"][lacking]) <= {"petsc-snes", "kinsol"}
    broken = {"ill conditioned"} if path.stem == "extremes" else set()
    assert set(results.runs["status"][~lacking]) == {"converged"} | broken
    assert len(results.runs) == len(results.study.cases)
    solved = results.runs[results.runs["status"] == "converged"]
    of_systems = solved[solved["velocity_error"].isna() & solved["form"].isna()]  # F(u) = 0 has roots, no velocity
    assert (of_systems["root_error"] < 1e-3).all()
    solved = solved.drop(of_systems.index)
    # 12 nodes around a tool whose layer is a fifth of their spacing: a field, but a coarse one, and it is said so.
    exact = solved["velocity_error"].notna()
    assert solved["velocity_error"][exact].between(0.0, 0.3).all()
    assert solved["velocity_error_estimate"][~exact].between(0.0, 0.3).all()  # the orbit
    assert (solved["doubt"] != "")[solved["velocity_error_inside"] > 0.1].all()
    assert (solved["residual_norm"] < 1e-5).all()
    for spec in results.study.tables:
        filled = results.table(spec.name).notna().any(axis=1)
        assert filled.any() if spec.cheapest else filled.all(), spec.name  # a coarse cloud reaches few errors
        assert {path.suffix for path in (tmp_path / "tables").glob(f"{spec.name}.*")} == {".csv", ".md", ".tex"}
    for figure in results.study.figures:
        assert (tmp_path / "figures" / f"{figure.name}.png").stat().st_size > 5000
        assert (tmp_path / "figures" / f"{figure.name}.pdf").stat().st_size > 2000


def test_equal_terms_are_equal(tmp_path):
    """In the first study every method meets one residual, so all end in one field, whatever their work."""
    runs = nlsolve.run(STUDIES / "first.toml", quick=True).runs
    assert runs["velocity_error"].max() - runs["velocity_error"].min() < 1e-6
    assert (runs["residual_norm"] <= 1e-8).all()
    newton = runs[runs["solver.kind"] == "newton"].iloc[0]
    assert newton["tangents"] == newton["triangular_solves"] == newton["iterations"]
    homotopy = runs[runs["solver.kind"] == "anm"]
    assert (homotopy["triangular_solves"] % homotopy["solver.order"] == 0).all()
