"""The report: what is on the page, what is escaped, what is said of failures."""

from __future__ import annotations

import os
import platform
import re
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from nlsolve.contracts.status import Status
from nlsolve.results.columns import RUNS as RESULTS
from nlsolve.show.expectations import Finding
from nlsolve.show.figures import LineFigure, draw, save
from nlsolve.show.report import machine_facts, write_report
from nlsolve.show.tables import TableSpec, build

RUNS = pd.DataFrame(
    {
        "case": ["a1", "b2", "c3"],
        "status": ["converged", "diverged", "singular tangent"],
        "message": ["fine", "the residual grew <fast> & far", None],
        "tangents": [88, 2, 1],
        "solver.order": [20.0, 10.0, np.nan],
        "solver.kind": ["anm", "anm", "newton"],
        "law.index": [0.1324, 0.1324, 0.1324],
    }
)


@pytest.fixture
def page(tmp_path: Path) -> str:
    figure = draw(LineFigure(name="runs", source="runs", x="solver.order", y="tangents"), RUNS, RUNS, RUNS)
    save(figure, tmp_path / "figures", "runs")
    tables: dict[str, str | pd.DataFrame] = {
        "branches <by> order": pd.DataFrame({"η = 1e-06": [208, 88]}, index=["<10>", "20"]),
        "ready made": "<table><tr><td>4711</td></tr></table>",
    }
    figures = [("runs", "Branches & orders."), ("lost", "Never drawn.")]
    path = write_report(tmp_path, "How many <tangents>?", tables, figures, RUNS)
    assert path == tmp_path / "report.html"
    assert sorted(p.name for p in tmp_path.iterdir()) == ["figures", "report.html"]
    return path.read_text(encoding="utf-8")


def test_question_is_the_heading_and_is_escaped(page: str) -> None:
    assert "<h1>How many &lt;tangents&gt;?</h1>" in page
    assert "<title>How many &lt;tangents&gt;?</title>" in page


def test_frames_become_escaped_tables_and_html_stays(page: str) -> None:
    assert "<h2>branches &lt;by&gt; order</h2>" in page
    assert "&lt;10&gt;" in page
    assert "<td>208</td>" in page
    assert "<td>4711</td>" in page


def test_endings_are_counted_and_failures_explained(page: str) -> None:
    assert re.search(r"3 cases: 1 converged, 1 diverged, 1 singular tangent\.", page)
    assert "the residual grew &lt;fast&gt; &amp; far" in page
    assert Status.SINGULAR_TANGENT.sentence in page  # no message was left, so the status speaks
    rows = re.findall(r'<tr><td class="words">.*?</tr>', page)
    assert len(rows) == 2
    assert "nan" not in rows[1]
    headings = re.findall(r'<th class="words">(.*?)</th>', page)
    assert headings == ["case", "solver.order", "solver.kind", "ending", "what happened"]


def test_a_variant_stands_for_what_its_settings_assign(tmp_path: Path) -> None:
    page = write_report(tmp_path, "?", {}, [], RUNS.assign(variant=["a", "b", "c"])).read_text(encoding="utf-8")
    assert re.findall(r'<th class="words">(.*?)</th>', page) == ["case", "variant", "ending", "what happened"]


def test_no_failures_no_section(tmp_path: Path) -> None:
    page = write_report(tmp_path, "?", {}, [], RUNS.iloc[:1]).read_text(encoding="utf-8")
    assert "did not converge" not in page
    assert "1 case: 1 converged." in page


def test_figures_are_linked_relatively_and_missing_ones_named(page: str) -> None:
    assert re.findall(r'<img src="([^"]*)"', page) == ["figures/runs.png"]
    assert "Branches &amp; orders." in page
    assert re.search(r"Never drawn\. <em>This figure could not be drawn", page)
    assert 300 < int(re.findall(r'width="(\d+)"', page)[0]) < 500


def test_page_needs_nothing_from_elsewhere(page: str) -> None:
    assert "http" not in page
    assert "<script" not in page


def test_machine_facts(page: str) -> None:
    facts = machine_facts()
    assert facts["numpy"] == np.__version__
    assert facts["Python"] == platform.python_version()
    assert facts["processors"] == str(os.cpu_count())
    assert set(facts) == {"nlsolve", "numpy", "scipy", "Python", "processors"}
    assert all(f"{name} {value}" in page for name, value in facts.items())


def test_unwritable_folder_is_the_callers_error(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(OSError, match="file"):
        write_report(tmp_path / "file" / "out", "?", {}, [], RUNS)


def test_findings_and_cases_that_were_left_out_are_on_the_page(tmp_path: Path) -> None:
    findings = [
        Finding("Order 20 <needs> few tangents.", ""),
        Finding("So does 10.", "tangents is 88, not 2"),
    ]
    excluded = [(f"p = {number}", "No order > 40 is worth it.") for number in range(41, 64)]
    page = write_report(tmp_path, "?", {}, [], RUNS, findings=findings, excluded=[("newton", "Too slow."), *excluded])
    text = page.read_text(encoding="utf-8")
    assert "<li>Order 20 &lt;needs&gt; few tangents. <strong>It holds.</strong></li>" in text
    assert "<strong>It does not hold: tangents is 88, not 2.</strong>" in text
    assert "<li>Too slow. 1 case: newton</li>" in text
    assert "<li>No order &gt; 40 is worth it. 23 cases: p = 41; p = 42" in text
    assert "p = 60; …</li>" in text
    assert "Findings" not in write_report(tmp_path, "?", {}, [], RUNS).read_text(encoding="utf-8")


def test_a_declared_table_is_escaped_wherever_it_is_named(tmp_path: Path) -> None:
    """In the caption, the names and the values of rows and columns, the cells, the labels and the notes."""
    bad = "<script>x</script>"
    frame = pd.DataFrame({"status": "converged", "row": [f"r{bad}"], "column": [f"c{bad}"], "lane": [f"v{bad}"]})
    frame = frame.reindex(columns=[*RESULTS, *(name for name in frame if name not in RESULTS)])
    given = {"name": "t", "caption": bad, "labels": {"lane": bad, "row": f"n{bad}"}, "notes": bad}
    for value in ("lane", ["lane", "status"]):
        spec = TableSpec.model_validate({**given, "rows": "row", "columns": "column", "value": value})
        table = build(spec, frame)
        frames = table.frames()
        page = write_report(tmp_path, "q", frames, [], RUNS, notes=dict.fromkeys(frames, table.notes)).read_text(
            "utf-8"
        )
        assert bad not in page
        assert page.count("&lt;script&gt;x&lt;/script&gt;") >= 5
