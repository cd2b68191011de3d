"""What tables and pictures say of where they come from, and whether those of a paper are those of the results."""

from __future__ import annotations

import re
import shutil
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st
from PIL import Image
from typesetting import compiled, needs

from nlsolve.registry.problems import StudyError
from nlsolve.show import plotting
from nlsolve.show.figures.paper.files import save
from nlsolve.show.figures.paper.look import Look
from nlsolve.show.provenance import Mark, Provenance, written_in, written_in_picture
from nlsolve.show.staleness import included
from nlsolve.show.tables import PREAMBLE
from nlsolve.show.tables.latex.floats import packages_of
from nlsolve.show.tables.spec import TableSpec

SPEC = TableSpec.model_validate({"name": "work", "rows": "solver.kind", "value": "tangents"})
MADE = Provenance("first", "nlsolve run first.toml --quick", "0.1.0", "2026-01-02")
BODY = "\\begin{table}\n50 \\% % not a comment of ours\n\\end{table}\n"


def text(digest: str = "abc", made: Provenance = MADE, body: str = BODY) -> str:
    return made.of("table", SPEC.name, digest).around(body, packages_of(SPEC))


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
    assert (found.noun, found.name, found.study, found.content) == ("table", "work", study, "abc")
    assert not found.edited


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


def nothing(noun: str, name: str) -> None:
    """Results without tables and figures."""


def reasons(paper, digests) -> dict[str, str]:
    return {each.name: each.reason for each in included(paper, "first", lambda noun, name: digests.get(name))}


def test_a_paper_whose_tables_are_those_of_the_results(paper):
    assert reasons(paper, {"work": "abc", "other": "def"}) == {"work": "", "other": ""}
    files = [each.file.name for each in included(paper, "first", lambda noun, name: "abc")]
    assert files == ["paper.tex", "work.tex"]


def test_a_stale_an_edited_and_a_vanished_table(paper):
    found = reasons(paper, {"work": "new"})
    assert found["work"] == "stale, the results tell something else now"
    assert found["other"] == "the results have no such table now"
    table = paper.parent / "tables" / "work.tex"
    table.write_text(text().replace("50", "60"), encoding="utf-8")
    assert reasons(paper, {"work": "abc"})["work"] == "edited by hand since it was written"


def test_what_cannot_be_checked(paper, tmp_path):
    with pytest.raises(StudyError, match=r"no table or figure of the study 'second' is in it"):
        included(paper, "second", nothing)
    with pytest.raises(StudyError, match=r"nowhere\.tex: cannot be read: No such file"):
        included(tmp_path / "nowhere.tex", "first", nothing)
    (tmp_path / "broken.tex").write_text("\\input{gone}", encoding="utf-8")
    with pytest.raises(StudyError, match=r"broken\.tex: includes gone, which is not there"):
        included(tmp_path / "broken.tex", "first", nothing)


def picture(folder, form: str, mark: Mark) -> Path:
    figure = plotting.Figure(figsize=(1, 1))
    figure.subplots().plot([1, 2])
    (path,) = save(figure, folder, mark.name, Look(formats=form), mark)
    return path


@pytest.mark.parametrize("study", ["first", "é & <b> (η) \\ {x} % ]]>"])
@pytest.mark.parametrize("form", ["png", "pdf", "svg"])
def test_a_picture_says_where_it_comes_from(tmp_path, form, study):
    made = Provenance(study, "nlsolve run x.toml --set 'a=\"(b)\"'", "0.1.0", "2026-01-02")
    path = picture(tmp_path, form, made.of("figure", "way", "abc"))
    (found,) = written_in_picture(path.read_bytes())
    assert (found.noun, found.name, found.study, found.content) == ("figure", "way", study, "abc")
    again = picture(tmp_path / "again", form, made.of("figure", "way", "abc"))
    assert again.read_bytes() == path.read_bytes()


def test_the_words_of_a_picture_are_there_for_other_programs(tmp_path):
    with Image.open(picture(tmp_path, "png", MADE.of("figure", "way", "abc"))) as png:
        said = (
            "Figure way of the study first, written by nlsolve run first.toml --quick with nlsolve 0.1.0 on 2026-01-02."
        )
        assert png.info["Description"] == said
    assert said in picture(tmp_path, "svg", MADE.of("figure", "way", "abc")).read_text("utf-8")
    assert said.encode() in picture(tmp_path, "pdf", MADE.of("figure", "way", "abc")).read_bytes()


def test_a_picture_of_others_and_one_whose_metadata_were_edited_say_nothing(tmp_path):
    assert list(written_in_picture(b"\x89PNG nothing")) == []
    assert list(written_in_picture(b'\x89PNG nlsolve: {"figure": ')) == []
    assert list(written_in_picture(b'\x89PNG nlsolve: {"figure": "way"}')) == []


def test_a_pgf_says_so_in_comments(tmp_path):
    needs("pdflatex")
    path = picture(tmp_path, "pgf", MADE.of("figure", "way", "abc"))
    text = path.read_text("utf-8")
    assert text.startswith("% Figure way of the study first, written by nlsolve run first.toml --quick\n")
    assert r"% Needs \usepackage{pgf}: see preamble.tex beside it." in text
    (found,) = written_in(text)
    assert (found.noun, found.name, found.content, found.edited) == ("figure", "way", "abc", False)
    assert next(written_in(text.replace("pgfpicture", "pgfpictures"))).edited is True
    assert compiled(tmp_path, r"\input{way.pgf}", "pdflatex").exists()


def test_the_pictures_of_a_paper(tmp_path):
    for name, form in {"way": "pdf", "cost": "png", "field": "svg", "drawn": "pgf"}.items():
        if form != "pgf" or shutil.which("pdflatex"):
            picture(tmp_path / "figures", form, MADE.of("figure", name, "abc"))
    (tmp_path / "figures" / "logo.png").write_bytes(b"\x89PNG")
    text = (
        "\\graphicspath{ {figures/} {other/}}\n\\includegraphics[width=\n\\linewidth]{way}% \\includegraphics{gone}\n"
        "\\includegraphics*{figures/cost.png}\\includegraphics{logo}\\includegraphics{elsewhere}\n\\includesvg{field}\n"
    )
    pgf = "\\input{figures/drawn.pgf}" if shutil.which("pdflatex") else ""
    (tmp_path / "paper.tex").write_text(text + pgf, encoding="utf-8")
    now = {"way": "abc", "cost": "new", "drawn": "abc"}
    found = reasons(tmp_path / "paper.tex", now)
    assert found.pop("drawn", "") == ""
    assert found == {
        "way": "",
        "cost": "stale, the results tell something else now",
        "field": "the results have no such figure now",
    }
