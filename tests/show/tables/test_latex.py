"""Tables in LaTeX: what they tell by default, what a declaration changes, how they fit, and what is typeset."""

from __future__ import annotations

import itertools
import re
import time
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from pydantic import ValidationError
from typesetting import ENGINES, as_letters, needs, typeset, words_on

import nlsolve
from nlsolve.registry.problems import StudyError
from nlsolve.results.columns import RUNS
from nlsolve.show.tables import TableSpec, build, check
from nlsolve.show.tables.latex.fit import ATTEMPTS, AVAILABLE, plan_of
from nlsolve.study.study import Study

STUDIES = Path(__file__).parent / "studies"


def runs(**columns) -> pd.DataFrame:
    frame = pd.DataFrame(
        {
            "status": "converged",
            "solver.order": [10, 10, 20, 20],
            "solver.tolerance": [1e-6, 1e-8, 1e-6, 1e-8],
            "tangents": [30.0, 40.0, 15.0, 20.0],
            "seconds": [1.5, 2.25, 0.01234, np.nan],
            "residual_norm": [2.704e-9, 1e-10, 3.456e-8, 4.7e-10],
        }
    ).assign(**columns)
    return frame.reindex(columns=[*RUNS, *(name for name in frame if name not in RUNS)])


def spec(**fields) -> TableSpec:
    given = {
        "name": "t",
        "rows": ["solver.order", "solver.tolerance"],
        "value": ["tangents", "seconds", "residual_norm"],
    }
    return TableSpec.model_validate(given | fields)


def body(table) -> list[str]:
    """The rows between the rules."""
    return re.search(r"\\midrule\n(.*)\n\\bottomrule", table.latex(), re.DOTALL)[1].splitlines()


# What a table tells without a word of how.


def test_symbols_units_and_numbers_are_those_of_the_columns():
    tex = build(spec(), runs()).latex()
    assert r"@{}r r S[table-format=2.0] S[table-format=1.4] S[table-format=1.1e-2]@{}" in tex
    assert r"order $p$ & tolerance $\eta$ & {tangents} & " in tex
    assert "time inside" in tex
    assert "{[}s{]}" in tex
    assert body(build(spec(), runs())) == [
        r"$10$ & $10^{-6}$ & 30 & 1.50 & 2.7e-9 \\",
        r" & $10^{-8}$ & 40 & 2.25 & 1.0e-10 \\",
        r"\addlinespace",
        r"$20$ & $10^{-6}$ & 15 & 0.0123 & 3.5e-8 \\",
        r" & $10^{-8}$ & 20 & {--} & 4.7e-10 \\",
    ]


def test_columns_of_a_parameter_stand_under_what_they_show():
    tex = build(spec(rows="solver.order", columns="solver.tolerance", value="seconds"), runs()).latex()
    assert r" & \multicolumn{2}{c}{time inside the method {[}s{]} by tolerance $\eta$} \\" in tex
    assert r"\cmidrule(lr){2-3}" in tex
    assert r"order $p$ & {$10^{-6}$} & {$10^{-8}$} \\" in tex


def test_several_values_of_each_parameter():
    table = build(spec(rows="solver.order", columns="solver.tolerance", value=["tangents", "seconds"]), runs())
    tex = table.latex()
    assert r"\multicolumn{2}{c}{tolerance $\eta$ = $10^{-6}$}" in tex
    assert r"\cmidrule(lr){2-3} \cmidrule(lr){4-5}" in tex


def test_a_failed_run_is_a_word_between_numbers():
    rows = body(build(spec(), runs(status=["diverged", "converged", "converged", "converged"])))
    assert rows[0] == r"$10$ & $10^{-6}$ & {diverged} & {diverged} & {diverged} \\"


def test_percent_stands_in_the_heading():
    tex = build(spec(value="residual_norm", format=".1%"), runs(residual_norm=[0.5, 0.25, 0.1, 0.015])).latex()
    assert r"relative residual {[}\%{]}" in tex
    assert "50.0 " in tex


def test_a_paper_stands_beside():
    paper = {"source": "s", "values": [[1e-9], [1e-10], [3.5e-8], [float("nan")]], "tolerance": 0.01}
    rows = body(build(spec(value="residual_norm", paper=paper), runs()))
    assert rows[0].endswith(r"$2.7 \times 10^{-9}$ ($1.0 \times 10^{-9}$) differs \\") or "same trend" in rows[0]
    assert rows[1].endswith(r"$1.0 \times 10^{-10}$ ($1.0 \times 10^{-10}$) within $1$ \% \\")
    assert rows[-1].endswith(r"$4.7 \times 10^{-10}$ \\")


def test_notes_stand_beneath():
    tex = build(spec(notes=["50 % of x_1.", "η is a range."]), runs()).latex()
    assert "50 \\% of x\\_1.\\par\n\\ensuremath{\\eta} is a range." in tex
    assert build(spec(notes="One."), runs()).notes[0] == "One."


# What a declaration changes.


def test_labels_are_printed_everywhere_but_in_data():
    given = {"tangents": "K* | new", "1e-06": "loose", "solver.order": "order"}
    table = build(spec(labels=given), runs())
    assert (
        table.markdown().splitlines()[0].replace(" ", "") == "|order|solver.tolerance|K\\*\\|new|seconds|residual_norm|"
    )
    assert "loose" in table.markdown()
    assert "{K{*} \\textbar{} new}" in table.latex()
    assert r"$10$ & loose & 30" in table.latex()
    assert table.csv().startswith("solver.order,solver.tolerance,tangents,seconds,residual_norm\n10,1e-06,30.0,1.5,")
    assert table.long()[0]["tangents"] == 30.0


def test_a_label_of_a_word_in_a_cell():
    table = build(spec(value="status", labels={"converged": "yes", "status": "arrived"}), runs())
    assert table.words.iloc[0, 0] == "yes"
    assert list(table.frames()["t"].columns) == ["arrived"]


def test_units_convert():
    table = build(spec(units={"seconds": "ms", "residual_norm": "%"}), runs())
    assert table.words["seconds"].tolist() == ["1500", "2250", "12.34", "–"]
    assert "seconds [ms]" in table.markdown()
    assert "{[}ms{]}" in table.latex()
    assert table.csv().splitlines()[1].endswith("30.0,1.5,2.704e-09")
    by_tolerance = build(
        spec(rows="solver.order", columns="solver.tolerance", value="seconds", units={"seconds": "ms"}), runs()
    )
    assert list(by_tolerance.frames()) == ["t [ms]"]


def test_a_unit_of_a_parameter_is_a_label():
    table = build(spec(units={"solver.order": "terms"}), runs())
    assert "solver.order [terms]" in table.markdown()
    assert r"\begin{tabular}[b]{@{}r@{}}order $p$ \\ {[}terms{]}\end{tabular}" in table.latex()
    assert body(table)[0].startswith("$10$ ")


@pytest.mark.parametrize(
    ("fields", "words"),
    [
        ({"digits": 2}, ["30.00", "1.50", "0.00"]),
        ({"digits": {"seconds": 1, "residual_norm": 10}}, ["30", "1.5", "0.0000000027"]),
        ({"figures": 3}, ["30.0", "1.50", "2.70e-09"]),
        ({"figures": {"residual_norm": 1}, "digits": 1}, ["30.0", "1.5", "3e-09"]),
        ({"figures": {"residual_norm": 1}, "format": ".3f"}, ["30.000", "1.500", "3e-09"]),
    ],
)
def test_digits_and_figures(fields, words):
    table = build(spec(**fields), runs())
    assert table.words.iloc[0].tolist() == words
    cells = [cell.replace("e-09", "e-9") for cell in words]  # as siunitx reads them
    assert body(table)[0].endswith(" & ".join(cells) + r" \\")


def test_digits_of_a_parameter():
    table = build(spec(digits={"solver.order": 1}), runs())
    assert body(table)[0].startswith("$10.0$ ")


def test_align():
    table = build(spec(align={"tangents": "left", "seconds": "right", "solver.order": "center"}), runs())
    assert "@{}c r l r S[" in table.latex()
    assert table.markdown().splitlines()[1].split("|")[1].strip().endswith("-:")
    assert table.rich()[0].columns[0].justify == "center"
    assert table.rich()[0].columns[2].justify == "left"


def test_label_and_caption():
    assert r"\label{tab:t}" not in build(spec(), runs()).latex()
    assert r"\label{tab:t}" in build(spec(caption="c"), runs()).latex()
    assert r"\label{work:1}" in build(spec(label="work:1"), runs()).latex()


@pytest.mark.parametrize(
    ("fields", "sentence"),
    [
        ({"digits": 2, "figures": 3}, "digits and figures exclude each other"),
        ({"digits": {"seconds": 2}, "figures": {"seconds": 2}}, "digits and figures of seconds exclude each other"),
        ({"digits": -1}, "greater than or equal to 0"),
        ({"figures": 0}, "greater than or equal to 1"),
        ({"units": {"seconds": "mm"}}, "units of seconds cannot be 'mm'; it can be shown in s, ms, µs, ns, min, h"),
        ({"units": {"tangents": "ms"}}, "units of tangents cannot be 'ms'; it can be shown in %"),
        ({"align": {"seconds": "middle"}}, "'left', 'center', 'right' or 'number'"),
        ({"width": "wide"}, "'single', 'half', 'double' or 'landscape'"),
        ({"fit": "shrink"}, "'auto', 'small', 'wrap' or 'split'"),
        ({"label": "a b"}, "pattern"),
    ],
)
def test_declarations_that_cannot_be(fields, sentence):
    with pytest.raises(ValidationError, match=re.escape(sentence)):
        spec(**fields)


def test_a_word_on_a_column_that_the_table_does_not_have():
    for field, given in (("units", "s"), ("align", "left"), ("digits", 1), ("figures", 1)):
        (problem,) = check(spec(**{field: {"secnds": given}}), [{"solver.order": 1, "solver.tolerance": 1e-6}])
        assert problem.place == (field,)
        assert problem.expected == "the table has no such column; did you mean 'seconds'?"


def test_a_label_of_nothing():
    (problem,) = check(spec(labels={"convrged": "yes"}), [{"solver.order": 1, "solver.tolerance": 1e-6}])
    assert problem.expected == "the table shows nothing of this name; did you mean 'converged'?"
    assert check(spec(labels={"a word of a message": "x"}), [{"solver.order": 1, "solver.tolerance": 1e-6}]) == []
    with pytest.raises(StudyError, match="did you mean '1e-06'"):
        build(spec(labels={"1e-6": "loose"}), runs())


# How it is made to fit.


def wide(names: int, rows: int = 4, word: str = "a strategy with a long name") -> pd.DataFrame:
    """Runs for a table of many columns."""
    pairs = list(itertools.product(range(rows), range(names)))
    frame = pd.DataFrame(
        {
            "status": "converged",
            "problem": [f"problem {row}" for row, _ in pairs],
            "strategy": [f"{word} {name}" for _, name in pairs],
            "seconds": [1.0 + row + name / 7 for row, name in pairs],
        }
    )
    return frame.reindex(columns=[*RUNS, *(name for name in frame if name not in RUNS)])


BY_STRATEGY = {"rows": "problem", "columns": "strategy", "value": "seconds", "caption": "Seconds"}


@pytest.mark.parametrize("fit", sorted(ATTEMPTS))
@pytest.mark.parametrize("width", sorted(AVAILABLE))
def test_a_plan_has_every_column_once(fit, width):
    for names in (1, 3, 8, 20):
        grid = build(spec(**BY_STRATEGY), wide(names)).grid()
        plan = plan_of(grid, AVAILABLE[width][0], fit)
        assert [column for part in plan.parts for column in part] == list(range(names))
        if fit in ("small", "wrap"):
            assert len(plan.parts) == 1


def test_what_fits_is_left_alone():
    tex = build(spec(**BY_STRATEGY), wide(2)).latex()
    assert r"\small" not in tex.replace(r"\smallskip", "")
    assert tex.count(r"\begin{tabular}{@{}l") == 1
    assert r"\begin{tabular}[" not in tex


def test_headings_are_wrapped_then_letters_smaller_then_columns_split():
    found = [build(spec(**BY_STRATEGY), wide(names)).latex() for names in (4, 9, 20)]
    assert r"\begin{tabular}[b]{@{}c@{}}" in found[0]
    assert [tex.count(r"\toprule") for tex in found] == [1, 1, 3]
    assert r"\footnotesize" in found[1]
    small, wrap, split = (build(spec(**BY_STRATEGY, fit=fit), wide(20)).latex() for fit in ("small", "wrap", "split"))
    assert (small.count(r"\toprule"), wrap.count(r"\toprule"), split.count(r"\toprule") > 3) == (1, 1, True)
    assert r"\footnotesize" in small
    assert r"\footnotesize" not in split


def test_a_table_higher_than_the_page_goes_on():
    tex = build(spec(**BY_STRATEGY, notes="A note."), wide(2, rows=100)).latex()
    assert tex.count(r"\begin{table}") == tex.count(r"\end{table}") == 3
    assert tex.count("Seconds (continued)") == tex.count(r"\addtocounter{table}{-1}") == 2
    assert tex.count(r"\label{tab:t}") == tex.count("A note.") == 1
    assert [tex.count(f"problem {row} &") for row in range(100)] == [1] * 100


def test_many_rows_are_written_in_a_time_that_grows_with_them():
    """Numbers, words and failures in 4000 rows: a look at all rows for each of them would take minutes."""
    frame = wide(1, rows=4000).assign(message="a word", tangents=1.5)
    table = build(spec(**BY_STRATEGY | {"rows": "problem", "columns": [], "value": ["seconds", "message"]}), frame)
    began = time.process_time()
    assert table.latex().count(r"\toprule") > 50
    assert time.process_time() - began < 20.0


def test_widths():
    tables = {width: build(spec(**BY_STRATEGY, width=width), wide(9)).latex() for width in AVAILABLE}
    assert r"\begin{table*}" in tables["double"]
    assert r"\begin{landscape}" in tables["landscape"]
    parts = {width: tex.count(r"\toprule") for width, tex in tables.items()}
    assert parts["half"] > parts["single"] >= parts["double"] >= parts["landscape"] == 1


# Typeset.


@pytest.fixture(scope="module")
def field_cases() -> dict[str, tuple[str, list[str]]]:
    """File -> table in LaTeX and the texts that it must show, of two studies with every special letter."""
    found = {}
    for path in sorted(STUDIES.glob("*.toml")):
        results = nlsolve.run(path, isolation="none")
        for table in results.tables():
            names = results.runs["the_variant"].tolist() if path.stem == "specials" else []
            found[table.spec.name] = (table.latex(), [table.spec.caption, *names])
    return found


def test_the_field_cases_are_all_there(field_cases):
    assert set(field_cases) == {"ascii", "caret", "backslash", "brace", "greek", "count", "specials_1", "wide"}


@pytest.mark.parametrize("engine", ENGINES)
def test_the_field_cases_show_every_letter(tmp_path, engine, field_cases):
    needs(engine)
    page = typeset(tmp_path, {name: tex for name, (tex, _) in field_cases.items()}, engine)
    shown = words_on(page)
    for _, texts in field_cases.values():
        for text in texts:
            for word in text.split():
                assert as_letters(word, engine) in shown, word


EVERY_LETTER = "!\"#$%&'()*+,-./:;<=>?@[\\]^_`{|}~ "


@pytest.mark.parametrize("engine", ENGINES)
def test_every_known_letter_is_typeset(tmp_path, engine):
    """In a caption, a heading, a label, a cell, a note, at the beginning of a row, and in twos."""
    needs(engine)
    from_letters = sorted({*EVERY_LETTER, *"ηπεφλμνΑΒΩ‖∇∂≤≥≠×·−→ℓ∞√⟨⟩𝑝ℎ°µ₀₁ₙ⁻⁹ⁿéèïñåçšőżßæøŁœ§¶©–—…“”‘’中😀"})
    words = [letter for letter in from_letters if not letter.isspace()]
    values = [f"{one}{one}{other} x" for one, other in zip(words, words[1:] + words[:1], strict=True)]
    frame = pd.DataFrame({"status": "converged", "name": values, "text": values, "tangents": 3.0})
    frame = frame.reindex(columns=[*RUNS, *(name for name in frame if name not in RUNS)])
    everything = " ".join(words)
    given = {"name": "t", "rows": "name", "value": ["text", "tangents"], "caption": everything, "notes": everything}
    table = build(TableSpec.model_validate(given | {"labels": {"tangents": everything}}), frame)
    shown = words_on(typeset(tmp_path, {"t": table.latex()}, engine))
    for letter in (*(word for word in words if word.isascii()), *"ηπλμΩ≤≥×éñåßø§"):
        assert as_letters(letter, engine) in shown, letter


IN_PAIRS = {"rows": ["problem", "strategy"], "value": "seconds", "caption": "Seconds"}


def test_a_space_parts_groups_of_rows_and_no_single_rows():
    tex = build(spec(**IN_PAIRS), wide(2)).latex()
    assert tex.count(r"\addlinespace") == 3
    every_other = wide(2).sort_values("strategy", kind="stable")
    assert r"\addlinespace" not in build(spec(**IN_PAIRS), every_other).latex()


def test_spaces_between_groups_of_rows_count_as_height(tmp_path):
    """Groups of two rows, which without their spaces would be a page high."""
    needs("pdflatex")
    tex = build(spec(**IN_PAIRS), wide(2, rows=20)).latex()
    assert typeset(tmp_path, {"t": tex}, "pdflatex").exists()


@pytest.mark.slow
@pytest.mark.parametrize("engine", ENGINES)
def test_what_is_too_wide_and_too_high_fits(tmp_path, engine):
    """The longest name that a setting may have, many columns, many rows, in every width and by every fit."""
    needs(engine)
    frames = {"columns": wide(20), "rows": wide(2, rows=100), "word": wide(2, word="x" * 100), "one": wide(1, rows=1)}
    texts = {
        f"{name}-{fit}-{width}": build(spec(**BY_STRATEGY, fit=fit, width=width), frame).latex()
        for name, frame in frames.items()
        for fit, width in (*((fit, "single") for fit in ATTEMPTS), ("auto", "landscape"))
    }
    narrow = {
        f"{name}-{width}": build(spec(**BY_STRATEGY, width=width), frame).latex()
        for name, frame in frames.items()
        for width in ("half", "double")
    }
    assert typeset(tmp_path / "one", texts, engine).exists()
    assert typeset(tmp_path / "two", narrow, engine, "[twocolumn]").exists()


def test_what_the_files_hold_is_what_is_typeset(tmp_path):
    """The files of a results folder, with their comments and their preamble."""
    needs("pdflatex")
    nlsolve.run(STUDIES / "plain.toml", tmp_path / "out", isolation="none")
    texts = {path.stem: path.read_text("utf-8") for path in (tmp_path / "out" / "tables").glob("*.tex")}
    assert texts.pop("preamble").count(r"\usepackage") == 4
    assert len(texts) == 6
    assert typeset(tmp_path / "paper", texts, "pdflatex").exists()


def test_the_study_of_specials_is_valid():
    assert len(Study.from_toml(STUDIES / "specials.toml").cases) == 5
