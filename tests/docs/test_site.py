"""The site: what its extensions write, and that its build finds links to nothing. `.ci/run` builds all pages."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

import gallery
import pytest
from docstrings import restructured
from flowchart import drawn as drawn_chart
from flowchart import laid_out
from links import broken, malformed, slug
from mathematics import mathml
from pages import PAGES

import nlsolve
import nlsolve.plugin
import nlsolve.testing

ROOT = Path(__file__).parents[2]
CONFIGURATION = ROOT / "docs"


def build(pages: dict[str, str], folder: Path) -> subprocess.CompletedProcess[str]:
    """Build a site of these pages by the configuration of the real one."""
    source = folder / "source"
    source.mkdir()
    for name, text in pages.items():
        (source / name).write_text(text, encoding="utf-8")
    command = [sys.executable, "-m", "sphinx", "-q", "-W", "--keep-going", "-b", "html", "-c", CONFIGURATION]
    return subprocess.run([*command, source, folder / "built"], capture_output=True, text=True, check=False)


def test_what_is_not_there_fails_the_build(tmp_path):
    pages = {
        "index.md": "# Site\n\n```{toctree}\none\n```\n",
        "one.md": "# One\n\n[a](nothing.md), [b](index.md#nowhere), [c](#here-neither)\n\n```{nothing}\n```\n"
        "\n```mermaid\npie\n```\n",
        "lost.md": "# Not in the list of pages\n",
        "names.md": "---\norphan: true\n---\n# Names\n\n```{eval-rst}\n.. autofunction:: nlsolve.dissolve\n```\n",
    }
    told = build(pages, tmp_path)
    assert told.returncode == 1
    for fault in (
        "nothing.md",
        "nowhere",
        "here-neither",
        "Unknown directive",
        "lost.md",
        "only 'flowchart TD' with lines 'upper --> lower' can be drawn, not 'pie'",
        "failed to import 'dissolve'",
    ):
        assert fault in told.stderr, fault


def test_what_is_there_passes(tmp_path):
    pages = {
        "index.md": "# Site\n\n[a](#a-heading), [one](one.md#one-two)\n\n## A heading\n\n```{toctree}\none\n```\n",
        "one.md": "# One two\n\n```{eval-rst}\n.. autofunction:: nlsolve.solve\n```\n\n"
        "```mermaid\nflowchart TD\n    a --> b\n```\n\nWhere $a_{\\max}$ is, and\n\n$$R = 0$$\n",
    }
    told = build(pages, tmp_path)
    assert told.returncode == 0, told.stderr
    html = (tmp_path / "built" / "one.html").read_text("utf-8")
    assert "u_0, (U,); may be left out" in html
    assert re.findall(r"<text [^>]*>(\w+)</text>", html) == ["a", "b"]
    assert "<msub><mi>a</mi>" in html
    assert 'display="block"' in html
    assert elsewhere(tmp_path / "built") == set()


REQUEST = re.compile(
    r"""<(?:script|img|iframe)\b[^>]*\bsrc="(https?:)?//[^"]*"|<link\b[^>]*\bhref="(https?:)?//[^"]*\""""
)


def elsewhere(site: Path) -> set[str]:
    """What pages and styles of a site ask of other sites as they are opened."""
    pages = {found[0] for page in site.rglob("*.html") for found in REQUEST.finditer(page.read_text(encoding="utf-8"))}
    styles = (page.read_text(encoding="utf-8") for page in site.rglob("*.css"))
    return pages | {
        url for style in styles for url in re.findall(r"url\(\s*['\"]?(?:https?:)?//[^)]*\)|@import[^;]*//", style)
    }


def test_what_asks_other_sites_is_found(tmp_path):
    page = '<script defer="defer" src="https://cdn.org/x.js"></script><img src="a.png"><a href="https://a.org">a</a>'
    (tmp_path / "page.html").write_text(f'{page}<link rel="stylesheet" href="//fonts.org/f.css" />', "utf-8")
    (tmp_path / "page.css").write_text("a { b: url('https://c.org/d.woff'); e: url(f.png) }", "utf-8")
    assert len(elsewhere(tmp_path)) == 3


def test_mathematics_that_cannot_be_set():
    with pytest.raises(ValueError, match=r"\\nothing in '\\\\nothing x' cannot be set"):
        mathml(r"\nothing x")


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("flowchart LR\na --> b", "not 'flowchart LR'"),
        ("flowchart TD\na --> b\nb -.-> c", "not 'b -.-> c'"),
        ("flowchart TD\na --> b\nb --> a", "in a circle"),
        ("", "not ''"),
    ],
)
def test_a_chart_that_cannot_be_drawn(text, said):
    with pytest.raises(ValueError, match=said):
        drawn_chart(text)


def test_a_chart_has_its_boxes_in_rows_and_arrows_round_them():
    across, ways = laid_out([("a", "b"), ("a", "c"), ("b", "d"), ("d", "e"), ("c", "e")])
    assert {name: row for name, row in across if len(name) == 1} == {"a": 0, "b": 1, "c": 1, "d": 2, "e": 3}
    assert (("c", 1), ("c e", 2), ("e", 3)) in ways
    assert len({(row, x) for (_, row), x in across.items()}) == len(across) == 6
    assert across["b", 1] == across["d", 2]
    assert across["c", 1] == across["c e", 2]


DOCSTRING = """\
K* W_j = |r| in `one` line.

solver : by kind, or
    a table.
a, b : numbers.

Words.

    code * here

- an item
"""


def test_docstrings_become_restructured_text():
    assert "\n".join(restructured(DOCSTRING.splitlines())) == (
        "K\\* W\\_j = \\|r\\| in ``one``\\  line.\n\n\n- solver : by kind, or\n  a table.\n- a, b : numbers.\n\n\n"
        "Words.\n\n::\n\n    code * here\n\n\n- an item"
    )


@pytest.mark.parametrize(
    ("heading", "anchor"),
    [
        ("Disturbed starts, small n and ε₀: `studies/a.toml`", "disturbed-starts-small-n-and-ε-studiesatoml"),
        ("`[[table]]`", "table"),
        ("range_rule - last-term", "range_rule---last-term"),
    ],
)
def test_anchors_are_those_of_github(heading, anchor):
    assert slug(heading) == anchor


@pytest.mark.parametrize("path", [*PAGES, ROOT / "CHANGELOG.md"], ids=lambda path: path.relative_to(ROOT).as_posix())
def test_links_lead_somewhere_where_the_page_is_read_as_it_is(path):
    assert broken(path) == []


def test_links_to_nothing_are_found(tmp_path):
    page, other = tmp_path / "page.md", tmp_path / "other.md"
    links = "[1](#a-b) [2](#c) [3](other.md) [4](other.md#x) [5](no.md#x) [6](https://example.org/#x) [7](#a-b-1)"
    page.write_text(f"# A `b`\n\n{links}\n\n# A b\n", encoding="utf-8")
    other.write_text("# Other\n\n```sh\n# x\n```\n", encoding="utf-8")
    assert broken(page) == ["#c", "other.md#x", "no.md#x"]


@pytest.mark.parametrize("path", [*PAGES, ROOT / "CHANGELOG.md"], ids=lambda path: path.relative_to(ROOT).as_posix())
def test_links_to_other_sites_are_well_formed(path):
    """Whether they lead somewhere is not asked: tests need no network."""
    assert malformed(path) == []


def test_malformed_links_are_found(tmp_path):
    page = tmp_path / "page.md"
    wrong = ["http://a.org/", "https:/a.org", "https://a", "ftp://a.org", "https://a.org/<x>", "htps://a.org"]
    links = "".join(f"[x]({link}) " for link in wrong)
    page.write_text(f"{links}[x](https://a-b.org/c/d.html#e) see https://a.org. And http://b.org `http://c`\n", "utf-8")
    assert sorted(malformed(page)) == sorted([*wrong, "http://b.org"])


@pytest.mark.slow
def test_the_site_is_built_and_has_every_public_name(tmp_path):
    command = [sys.executable, "-m", "sphinx", "-q", "-W", "--keep-going", "-b", "html", CONFIGURATION, tmp_path]
    told = subprocess.run(command, capture_output=True, text=True, check=False)
    assert told.returncode == 0, told.stderr
    assert elsewhere(tmp_path) == set()
    html = "".join(page.read_text(encoding="utf-8") for page in (tmp_path / "reference").glob("*.html"))
    for door in (nlsolve, nlsolve.plugin, nlsolve.testing):
        missing = {
            name for name in door.__all__ if f'id="{door.__name__}.{name}"' not in html and f">{name}<" not in html
        }
        assert missing - {"__version__"} == set()


@pytest.fixture
def drawn(tmp_path, monkeypatch):
    monkeypatch.setattr(gallery, "DRAWN", ROOT / "build" / "nothing")
    return gallery


def test_a_study_without_pictures_says_how_they_are_drawn(drawn):
    sections = "\n".join(drawn.page())
    assert sections.count("## studies/") == len(drawn.studies()) > 8
    assert "`python docs/gallery.py paper/figures` draws it" in sections


def test_pictures_are_shown_with_their_captions(monkeypatch, tmp_path):
    monkeypatch.setattr(gallery, "DRAWN", tmp_path)
    monkeypatch.setattr(gallery, "ROOT", tmp_path)
    folder = gallery.folder("first", full=False) / "figures"
    folder.mkdir(parents=True)
    (folder / "residual.png").touch()
    section = "\n".join(gallery.page()).partition("## studies/first.toml")[2].partition("## ")[0]
    assert "Quick form" in section
    assert "```{figure} ../quick/first/figures/residual.png" in section
    assert section.count("Residual that the homotopy") == 2
