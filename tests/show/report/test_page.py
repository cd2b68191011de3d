"""The report: what is on the page, what is escaped, what is said of failures."""

from __future__ import annotations

import os
import platform
import re
from base64 import b64decode
from html import unescape
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from nlsolve.contracts.status import Status
from nlsolve.results.columns import RUNS as RESULTS
from nlsolve.results.frames import Frames
from nlsolve.show.expectations import Finding
from nlsolve.show.figures import LineFigure, write
from nlsolve.show.provenance import Provenance
from nlsolve.show.report import Picture, machine_facts, write_report
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


def table(page: str, section: str) -> tuple[list[str], list[list[str]]]:
    """Headings and rows of the first table of a section."""
    (text,) = re.findall(rf'<section id="{section}".*?</section>', page, re.DOTALL)
    body = text.split("</table>")[0]
    rows = [re.findall(r"<td[^>]*>(.*?)</td>", row) for row in re.findall(r"<tr>(<td.*?)</tr>", body)]
    return re.findall(r"<th [^>]*>(.*?)</th>", body), [[unescape(cell) for cell in row] for row in rows]


@pytest.fixture
def page(tmp_path: Path) -> str:
    spec = LineFigure(name="runs", source="runs", x="solver.order", y="tangents", formats=("pdf",))
    written = write(spec, Frames(RUNS, RUNS, RUNS), tmp_path / "figures")
    files = tuple(f"figures/{path.name}" for path in written.paths)
    tables = {"branches <by> order": pd.DataFrame({"η = 1e-06": [208, 88]}, index=["<10>", "20"])}
    figures = [
        Picture("runs", "Branches & orders.", written.png, written.inches, None, files),
        Picture("lost", "Never drawn."),
    ]
    path = write_report(tmp_path, "How many <tangents>?", tables, figures, RUNS)
    assert path == tmp_path / "report.html"
    assert sorted(p.name for p in tmp_path.iterdir()) == ["figures", "report.html"]
    return path.read_text(encoding="utf-8")


def test_question_is_the_heading_and_is_escaped(page: str) -> None:
    assert "<h1>How many &lt;tangents&gt;?</h1>" in page
    assert "<title>How many &lt;tangents&gt;?</title>" in page


def test_frames_become_escaped_tables(page: str) -> None:
    assert "<h2>branches &lt;by&gt; order</h2>" in page
    assert "&lt;10&gt;" in page
    assert re.findall(r'<tr><td class="words">&lt;10&gt;</td><td class="numbers">208</td></tr>', page)


def test_endings_are_counted_and_failures_explained(page: str) -> None:
    assert re.search(r"3 cases: 1 converged, 1 diverged, 1 singular tangent\.", page)
    assert "the residual grew &lt;fast&gt; &amp; far" in page
    assert Status.SINGULAR_TANGENT.sentence in page  # no message was left, so the status speaks
    headings, rows = table(page, "failures")
    assert headings == ["case", "solver.order", "solver.kind", "ending", "what happened"]
    assert [row[0] for row in rows] == ["b2", "c3"]
    assert rows[1][1] == ""


def test_a_variant_stands_for_what_its_settings_assign(tmp_path: Path) -> None:
    page = write_report(tmp_path, "?", {}, [], RUNS.assign(variant=["a", "b", "c"])).read_text(encoding="utf-8")
    assert table(page, "failures")[0] == ["case", "variant", "ending", "what happened"]
    by = write_report(tmp_path, "?", {}, [], RUNS, by=["law.index", "gone"]).read_text(encoding="utf-8")
    assert table(by, "failures")[0] == ["case", "law.index", "ending", "what happened"]


def test_no_failures_no_section(tmp_path: Path) -> None:
    page = write_report(tmp_path, "?", {}, [], RUNS.iloc[:1]).read_text(encoding="utf-8")
    assert "did not converge" not in page
    assert "1 case: 1 converged." in page


def test_figures_are_in_the_page_and_missing_ones_named(page: str) -> None:
    (address,) = re.findall(r'<img src="([^"]*)"', page)
    assert b64decode(address.removeprefix("data:image/png;base64,")).startswith(b"\x89PNG")
    assert re.findall(r'<a href="(figures[^"]*)">', page) == ["figures/runs.pdf", "figures/runs.csv"]
    assert "Branches &amp; orders." in page
    assert re.search(r"Never drawn\. <em>This figure could not be drawn", page)
    assert 300 < int(re.findall(r'width="(\d+)"', page)[0]) < 500


def test_page_needs_nothing_from_elsewhere(page: str) -> None:
    assert "http" not in page.replace("http-equiv", "")
    policy = re.findall(r'http-equiv="Content-Security-Policy" content="([^"]*)"', page)
    assert [part for part in policy[0].split("; ") if part.startswith("default")] == ["default-src 'none'"]
    addresses = re.findall(r'(?:src|href)="([^"]*)"', page)
    assert all(address.startswith(("data:", "#", "figures/")) for address in addresses)
    assert re.findall(r"<script[^>]*>", page) == ["<script>"]
    assert len(page.split("<script>")[1]) < 3000


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
        frames = table.flat()
        page = write_report(tmp_path, "q", frames, [], RUNS, notes=dict.fromkeys(frames, table.notes)).read_text(
            "utf-8"
        )
        assert bad not in page
        assert page.count("&lt;script&gt;x&lt;/script&gt;") >= 5
        assert page.count("<script>") == 1


TIMED = RUNS.assign(
    **{
        "seconds": [4.0, 1.0, 0.0],
        "seconds_factorization": [3.0, 0.5, 0.0],
        "seconds_own": [1.0, 0.5, np.nan],
        "seconds_start": [0.25, 0.0, 0.0],
        "lane": "alone",
        "doubt": ["", "the nodes are too far apart for <layers>: choose a finer spacing", None],
        "audit.resolution": [0.5, 14.0, np.nan],
        "audit.heating": [np.nan, np.nan, np.nan],
    }
)


def test_doubts_and_audits_are_in_words(tmp_path: Path) -> None:
    page = write_report(tmp_path, "?", {}, [], TIMED).read_text(encoding="utf-8")
    assert "3 cases: 1 converged, 1 diverged, 1 singular tangent. 1 is in doubt." in page
    headings, rows = table(page, "audit")
    assert headings == ["case", "solver.order", "solver.kind", "ending", "what is in doubt"]
    assert rows == [["b2", "10", "anm", "diverged", TIMED["doubt"][1]]]
    assert "<layers>" not in page
    assert re.findall(r"<td[^>]*>(resolution|heating)</td><td[^>]*>([\d.]+)</td><td[^>]*>(\d)</td>", page) == [
        ("resolution", "14", "2")
    ]
    certain = write_report(tmp_path, "?", {}, [], TIMED.assign(doubt="")).read_text(encoding="utf-8")
    assert "No result is in doubt." in certain
    assert "in doubt." not in write_report(tmp_path, "?", {}, [], RUNS).read_text(encoding="utf-8")


def test_cost_is_told_by_part_and_by_case(tmp_path: Path) -> None:
    page = write_report(tmp_path, "?", {}, [], TIMED).read_text(encoding="utf-8")
    sentence = "The methods took 5 s in all: 70 % factorising, 30 % work of the method itself. "
    assert sentence + "Beside these: 0.25 s first states." in page
    headings, rows = table(page, "cost")
    parts = ["inside the method [s]", "factorising [s]", "work of the method itself [s]", "first states [s]", "lane"]
    assert headings == ["case", "solver.order", "solver.kind", *parts]
    assert rows[0] == ["a1", "20", "anm", "4", "3", "1", "0.25", "alone"]
    assert f'title="column seconds: {RESULTS["seconds"].meaning}"' in page
    assert 'id="cost"' not in write_report(tmp_path, "?", {}, [], RUNS).read_text(encoding="utf-8")


def test_of_very_many_cases_the_dearest_are_told(tmp_path: Path) -> None:
    many = pd.DataFrame({"case": [f"c{n}" for n in range(300)], "status": "converged", "seconds": np.arange(300.0)})
    page = write_report(tmp_path, "?", {}, [], many).read_text(encoding="utf-8")
    _, rows = table(page, "cost")
    assert [row[0] for row in rows] == [f"c{n}" for n in range(100, 300)]
    assert "These are the 200 dearest of 300 cases; runs.csv has all." in page


def test_the_page_says_how_to_run_the_study_again(tmp_path: Path) -> None:
    def said(provenance: Provenance | None) -> str:
        page = write_report(tmp_path / "r", "?", {}, [], RUNS, provenance=provenance).read_text(encoding="utf-8")
        return page.split('<section id="rerun">')[1]

    command = "nlsolve run 'a <b>.toml' --out r"
    assert "<pre>nlsolve run &#39;a &lt;b&gt;.toml&#39; --out r</pre>" in said(Provenance("<b>", command, "1", "today"))
    assert "<footer>Study &lt;b&gt;, nlsolve 1, today</footer>" in said(Provenance("<b>", command, "1", "today"))
    assert "was run from Python: <code>nlsolve.run</code>" in said(Provenance("s", "", "1", "today"))
    assert "what is not in r yet" in said(None)


def test_remarks_stand_at_the_top(tmp_path: Path) -> None:
    page = write_report(tmp_path, "?", {}, [], RUNS, remarks=["2 of <3> cases are finished"]).read_text("utf-8")
    assert "2 of &lt;3&gt; cases are finished" in page.split("<nav>")[0]


def test_an_animation_is_in_the_page(tmp_path: Path) -> None:
    films = [Picture(form, "", b"png", 3.5, (b"moving", form)) for form in ("gif", "apng", "mp4")]
    page = write_report(tmp_path, "?", {}, films, RUNS).read_text(encoding="utf-8")
    for address in ("data:image/gif;base64,bW92aW5n", "data:image/apng;base64,bW92aW5n"):
        assert f'<img class="film" src="{address}"' in page
    assert '<video class="film" src="data:video/mp4;base64,bW92aW5n"' in page
