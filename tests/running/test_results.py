"""Results at hand: fields at any point, states, figures, files of other programs, and what a notebook shows."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import meshio
import numpy as np
import pandas as pd
import pytest

import nlsolve
from nlsolve.results.columns import FIELDS
from nlsolve.results.states import exports

COUETTE = {
    "question": "Is <b>this</b> a question?",
    "scene": {"kind": "couette", "nodes": {"kind": "rings", "spacing": 0.5}},
    "law": {"kind": "power-law", "index": 0.5, "regularization": 1e-3},
    "discretizer": {"kind": "mls"},
    "solver": {"kind": "newton"},
    "physics": {"penalty": 100.0},
    "figure": [{"kind": "field", "name": "speed", "value": "rate"}],
}
BRATU = {"question": "What is u?", "scene": {"kind": "bratu"}, "solver": {"kind": "newton"}}


@pytest.fixture(scope="module")
def couette() -> nlsolve.Results:
    return nlsolve.run(COUETTE, isolation="none")


@pytest.fixture(scope="module")
def bratu() -> nlsolve.Results:
    return nlsolve.run(BRATU, isolation="none")


def with_linear_velocity(results: nlsolve.Results) -> nlsolve.Results:
    x, y = results.fields["x"], results.fields["y"]
    return replace(results, fields=results.fields.assign(u=3.0 - 2.0 * x + 0.5 * y, v=x - 7.0 * y))


def test_fields_at_points_are_exact_for_linear_fields_and_nan_outside_of_the_material(couette):
    angle = np.linspace(0.0, 2.0 * np.pi, 50)
    points = np.concatenate([r * np.stack([np.cos(angle), np.sin(angle)], axis=1) for r in (1.7, 3.3, 5.9)])
    found = with_linear_velocity(couette).at(0, points)
    assert list(found.columns[:2]) == ["x", "y"]
    np.testing.assert_allclose(found["u"], 3.0 - 2.0 * points[:, 0] + 0.5 * points[:, 1], rtol=0, atol=1e-12)
    np.testing.assert_allclose(found["v"], points[:, 0] - 7.0 * points[:, 1], rtol=0, atol=1e-12)
    outside = couette.at(0, [[0.0, 0.0], [1.0, 0.3], [6.1, 0.0], [1e3, 1e3]])  # the tool has a radius of 1.5 mm
    assert outside[["u", "rate", "pressure"]].isna().all(axis=None)


def test_fields_at_the_nodes_are_those_of_the_nodes(couette):
    nodes = couette.fields
    found = couette.at(nodes["case"][0], nodes[["x", "y"]].to_numpy())
    for name in ("u", "v", "exx", "rate", "viscosity", "sxy", "pressure"):
        np.testing.assert_allclose(found[name], nodes[name], rtol=1e-9, atol=1e-9)


def test_the_stress_is_that_of_the_law_at_the_strain_rate_of_the_node(couette):
    fields = couette.fields
    law = couette.study.cases[0].parts.law
    np.testing.assert_allclose(fields["viscosity"], law.viscosity(fields["rate"].to_numpy() ** 2))
    for component in ("xx", "yy", "xy"):
        np.testing.assert_allclose(fields[f"s{component}"], 2.0 * fields["viscosity"] * fields[f"e{component}"])
    assert np.isfinite(fields["pressure"]).all()


def test_the_pressure_is_that_of_the_penalty(couette):
    """p = −λ tr ε̇ where no pressure is iterated: of the size of λ times the divergence that the case reports."""
    run, parts = couette.runs.iloc[0], couette.study.cases[0].parts
    modulus = parts.physics.penalty_modulus(parts.law, parts.scene.reference_rate, np.ones(1))
    fields = couette.fields
    expected = modulus * run["divergence"] * np.sqrt(np.mean(fields["rate"] ** 2))
    assert 0.2 < np.sqrt(np.mean(fields["pressure"] ** 2)) / expected < 5.0
    without = {**COUETTE, "physics": {}, "scene": {"kind": "couette", "nodes": {"kind": "rings", "spacing": 0.75}}}
    assert nlsolve.run(without, isolation="none").fields["pressure"].isna().all()


def test_the_state_of_a_system_is_stored(bratu, tmp_path):
    u = bratu.state(0)
    assert len(u) == bratu.runs["unknowns"][0]
    problem = bratu.study.cases[0].parts.scene.equations()
    assert np.linalg.norm(problem.residual(u)) < 1e-6
    kept = nlsolve.run(BRATU, tmp_path, isolation="none")
    np.testing.assert_array_equal(nlsolve.load(tmp_path).state(kept.runs["case"][0]), u)


def test_the_state_of_a_flow_is_its_velocity(couette):
    np.testing.assert_array_equal(couette.state(0), couette.fields[["u", "v"]].to_numpy())


@pytest.mark.parametrize(
    ("ask", "sentence"),
    [
        (lambda r: r.at("nothing", [[2.0, 0.0]]), "case = 'nothing': no such case in these results; there are"),
        (lambda r: r.at(1, [[2.0, 0.0]]), "case = 1: there are 1 rows in `runs`, from 0 to 0"),
        (lambda r: r.at(0, [[1.0, 2.0, 3.0]]), r"points of shape \(1, 3\): should be of shape \(P, 2\)"),
        (lambda r: r.at(0, [[2.0, 0.0]], time=0.5), "time = 0.5: fields were recorded at t = 0 s; choose one of them"),
        (lambda r: r.to_vtk("a.stl", 0), "a.stl: to_vtk writes files called .vtu or .vtk"),
        (lambda r: r.plot("fild"), r"results.plot\('fild'\): .*; the study declares speed"),
        (lambda r: r.plot("field", value="q"), r"results.plot\('field'\): value: Input should be"),
        (lambda r: r.plot("line", y="nonsense"), 'results.plot: figure "line": .*nonsense'),
        (lambda r: replace(r, fields=r.fields[:0]).at(0, [[2.0, 0.0]]), "it has left no state; its status and message"),
    ],
)
def test_what_cannot_be_given_is_said(couette, ask: Callable[[nlsolve.Results], Any], sentence: str):
    with pytest.raises(nlsolve.StudyError, match=sentence):
        ask(couette)


def test_a_system_has_no_places(bratu, tmp_path):
    for ask in (lambda: bratu.at(0, [[0.0, 0.0]]), lambda: bratu.to_vtk(tmp_path / "a.vtu", 0)):
        with pytest.raises(
            nlsolve.StudyError, match=r"it is a system, whose state has no places: ask for results\.state"
        ):
            ask()


def test_a_figure_in_one_call(couette, bratu):
    assert couette.plot("speed").axes[0].get_xlabel()
    for value in ("u", "pressure", "viscosity", "sxy"):
        assert couette.plot("field", value=value).axes
    assert couette.plot("profile", axis="x", value="pressure").axes
    assert couette.plot("field", value="viscosity", log=True).axes
    assert couette.plot("cloud").axes
    assert bratu.plot("line", y="residual_norm").axes


def test_a_file_that_other_programs_read(couette, tmp_path):
    mesh = meshio.read(couette.to_vtk(tmp_path / "flow.vtu", 0))
    fields = couette.fields
    np.testing.assert_array_equal(mesh.points[:, :2], fields[["x", "y"]])
    np.testing.assert_array_equal(mesh.point_data["velocity"][:, :2], fields[["u", "v"]])
    np.testing.assert_array_equal(mesh.point_data["stress"], fields[["sxx", "syy", "sxy"]])
    np.testing.assert_array_equal(mesh.point_data["pressure"], fields["pressure"])
    corners = mesh.cells_dict["triangle"]
    (ax, bx, cx), (ay, by, cy) = mesh.points[corners, 0].T, mesh.points[corners, 1].T
    area = 0.5 * np.abs((bx - ax) * (cy - ay) - (by - ay) * (cx - ax)).sum()
    assert area == pytest.approx(np.pi * (6.0**2 - 1.5**2), rel=0.03)


def test_a_data_set_of_xarray(couette, bratu):
    flow = couette.to_xarray(0)
    assert dict(flow.sizes) == {"time": 1, "node": len(couette.fields)}
    np.testing.assert_array_equal(flow["u"][0], couette.fields["u"])
    assert flow["pressure"].attrs == {"units": "MPa", "long_name": FIELDS["pressure"].meaning}
    assert set(flow.coords) == {"time", "node", "x", "y", "x0", "y0", "boundary"}
    system = bratu.to_xarray(0)
    np.testing.assert_array_equal(system["value"], bratu.state(0))


@pytest.mark.parametrize(
    ("library", "extra", "method"), [("meshio", "mesh", "to_vtk"), ("xarray", "xarray", "to_xarray")]
)
def test_an_extra_that_is_absent_is_said_in_a_sentence(couette, monkeypatch, tmp_path, library, extra, method):
    def missing(name: str) -> Any:
        raise ImportError(f"No module named {name!r}")

    monkeypatch.setattr(exports, "import_module", missing)
    arguments = (tmp_path / "a.vtu", 0) if method == "to_vtk" else (0,)
    with pytest.raises(nlsolve.StudyError) as caught:
        getattr(couette, method)(*arguments)
    assert str(caught.value) == f"{method} needs the library {library}: pip install 'nlsolve[{extra}]'"


def test_values_print_short_and_notebooks_show_them_escaped(couette, bratu):
    march = nlsolve.march({key: value for key, value in COUETTE.items() if key != "figure"})
    outcome = nlsolve.solve(lambda u: u**2 - 2.0, np.ones(1))
    for value in (couette, couette.study, march, outcome):
        assert len(repr(value).splitlines()) <= 10
        assert len(repr(value)) < 1000
        page = value._repr_html_()
        assert page.startswith("<table>")
        assert "<b>" not in page
    assert "1: 1 converged" in repr(couette)
    assert "question  Is <b>this</b> a question?" in repr(couette)
    assert "&lt;b&gt;this&lt;/b&gt;" in couette._repr_html_()
    assert "&lt;b&gt;this&lt;/b&gt;" in couette.study._repr_html_()
    tables = {"question": "q", "table": [{"name": "t", "rows": "solver.kind", "value": "iterations"}]}
    shown = nlsolve.run({**BRATU, **tables}, isolation="none")._repr_html_()
    assert "<h4>t</h4>" in shown


def test_a_long_frame_shows_its_ends_in_a_notebook():
    page = nlsolve.contracts.notebook.frame("<i>", pd.DataFrame({"a<": range(1000)}))
    assert page.count("<tr") < 70
    assert page.startswith("<h4>&lt;i&gt;</h4>")
    assert "a&lt;" in page


def test_iterates_are_recorded_on_request_in_memory_and_in_a_folder(tmp_path):
    asked = {**BRATU, "record": {"iterates": True}}
    in_memory = nlsolve.run(asked)
    u = in_memory.iterates(0)
    assert u.shape == (len(in_memory.steps), in_memory.runs["unknowns"][0])
    np.testing.assert_array_equal(u[-1], in_memory.state(0))
    differences = in_memory.steps["difference"].to_numpy()[1:]
    assert (np.diff(np.linalg.norm(np.diff(u, axis=0), axis=1)) < 0.0).all()
    assert np.isfinite(differences).all()
    problem = in_memory.study.cases[0].parts.scene.equations()
    norms = [np.linalg.norm(problem.residual(state)) for state in u]
    np.testing.assert_allclose(norms, in_memory.steps["residual_absolute"], rtol=1e-9, atol=1e-14)
    first = nlsolve.run(BRATU, tmp_path)
    with pytest.raises(
        nlsolve.StudyError, match=r"its iterates were not recorded: run the study with record = \{ iter"
    ):
        first.iterates(0)
    told = []
    again = nlsolve.run(asked, tmp_path, listen=told.append)
    assert not any(event.resumed for event in told), "iterates that are not there are computed"
    assert list(again.runs["case"]) == list(first.runs["case"]), "they do not tell cases apart"
    np.testing.assert_array_equal(again.iterates(0), u)
    np.testing.assert_array_equal(nlsolve.load(tmp_path).iterates(0), u)
    told.clear()
    for study in (asked, BRATU):
        assert nlsolve.run(study, tmp_path, listen=told.append).iterates(0).shape == u.shape
    assert all(event.resumed for event in told), "a case with iterates serves a study that asks for none"


def test_the_iterates_of_a_march_are_the_states_of_its_steps(couette):
    asked = {
        **COUETTE,
        "scene": {"kind": "couette", "nodes": {"kind": "rings", "spacing": 0.75}},
        "time": {"horizon": 2e-4, "increment": 1e-4},
        "physics": {"inertia": True},
        "record": {"iterates": True},
    }
    results = nlsolve.run({key: value for key, value in asked.items() if key != "figure"}, isolation="none")
    assert results.iterates(0).shape == (len(results.steps), results.runs["unknowns"][0])
    assert set(results.steps["increment"]) == {1, 2}
