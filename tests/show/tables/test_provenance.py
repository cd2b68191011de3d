"""What a table in LaTeX says of where it comes from, and whether a paper's tables are those of the results."""

from __future__ import annotations

import re

import pytest
from hypothesis import given
from hypothesis import strategies as st

from nlsolve.registry.problems import StudyError
from nlsolve.show.tables import PREAMBLE, Provenance, included_tables
from nlsolve.show.tables.latex.floats import packages_of
from nlsolve.show.tables.latex.provenance import written_in
from nlsolve.show.tables.spec import TableSpec

SPEC = TableSpec.model_validate({"name": "work", "rows": "solver.kind", "value": "tangents"})
MADE = Provenance("first", "nlsolve run first.toml --quick", "0.1.0", "2026-01-02")
BODY = "\\begin{table}\n50 \\% % not a comment of ours\n\\end{table}\n"


def text(digest: str = "abc", made: Provenance = MADE, body: str = BODY) -> str:
    return made.around(SPEC, digest, body)


def test_comments_say_where_a_table_comes_from_and_what_it_needs():
    lines = text().splitlines()
    assert lines[0] == "% Table work of the study first, written by nlsolve run first.toml --quick"
    assert lines[1] == "% with nlsolve 0.1.0 on 2026-01-02."
    assert lines[2] == r"% Needs \usepackage{booktabs, graphicx, siunitx}: see preamble.tex beside it."
    assert all(rf"\usepackage{{{name}}}" in PREAMBLE for name in packages_of(SPEC.with_(width="landscape")))
    assert "from Python" in text(made=Provenance("s", "", "0.1.0", "2026-01-02"))


@given(st.text(), st.text())
def test_comments_are_comments_whatever_a_study_is_called(study, command):
    made = text(made=Provenance(study, command, "0.1.0", "2026-01-02"))
    outside = made.replace(BODY, "").splitlines()
    assert all(line.startswith("%") for line in outside)
    (found,) = written_in(made)
    assert (found.table, found.study, found.content, found.edited) == ("work", study, "abc", False)


def test_the_date_makes_nothing_stale_and_an_edit_is_seen():
    later = text(made=Provenance("first", "nlsolve run x.toml", "0.2.0", "2027-01-01"))
    assert next(written_in(later)) == next(written_in(text()))
    assert next(written_in(text().replace("\n", "  \r\n"))).edited is False
    assert next(written_in(text().replace("50", "60"))).edited is True


def test_a_comment_that_was_broken_says_nothing():
    assert list(written_in(re.sub(r"% nlsolve: .*", "% nlsolve: {", text()))) == []


@pytest.fixture
def paper(tmp_path):
    """A paper that includes a file that includes a table, and has another table in itself."""
    (tmp_path / "tables").mkdir()
    (tmp_path / "tables" / "work.tex").write_text(text(), encoding="utf-8")
    (tmp_path / "section.tex").write_text("\\input{tables/work}\n\\input{section}\n", encoding="utf-8")
    pasted = text("def").replace('"work"', '"other"')
    made = f"\\include{{section}} % \\input{{gone}}\n50 \\% \\input tables/work.tex\n{pasted}"
    (tmp_path / "paper.tex").write_text(made, encoding="utf-8")
    return tmp_path / "paper.tex"


def reasons(paper, digests) -> dict[str, str]:
    return {each.table: each.reason for each in included_tables(paper, "first", digests)}


def test_a_paper_whose_tables_are_those_of_the_results(paper):
    assert reasons(paper, {"work": "abc", "other": "def"}) == {"work": "", "other": ""}
    files = [each.file.name for each in included_tables(paper, "first", {"work": "abc", "other": "def"})]
    assert files == ["paper.tex", "work.tex"]


def test_a_stale_an_edited_and_a_vanished_table(paper):
    found = reasons(paper, {"work": "new"})
    assert found["work"] == "stale, the results tell something else now"
    assert found["other"] == "the results have no such table now"
    table = paper.parent / "tables" / "work.tex"
    table.write_text(text().replace("50", "60"), encoding="utf-8")
    assert reasons(paper, {"work": "abc"})["work"] == "edited by hand since it was written"


def test_what_cannot_be_checked(paper, tmp_path):
    with pytest.raises(StudyError, match=r"no table of the study 'second' is in it"):
        included_tables(paper, "second", {})
    with pytest.raises(StudyError, match=r"nowhere\.tex: cannot be read: No such file"):
        included_tables(tmp_path / "nowhere.tex", "first", {})
    (tmp_path / "broken.tex").write_text("\\input{gone}", encoding="utf-8")
    with pytest.raises(StudyError, match=r"broken\.tex: includes gone, which is not there"):
        included_tables(tmp_path / "broken.tex", "first", {})
