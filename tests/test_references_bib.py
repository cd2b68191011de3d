"""Every work that the code or the docs cite as author and year has an entry in docs/references.bib."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent
BIBLIOGRAPHY = ROOT / "docs" / "references.bib"
SOURCES = sorted(
    [*ROOT.glob("nlsolve/**/*.py"), *ROOT.glob("plugins/**/*.py"), *ROOT.glob("docs/**/*.md"), ROOT / "README.md"]
)
NAME = r"[A-Z][^\W\d_]+(?:-[A-Z][^\W\d_]+)*"
LATER_NAME = rf"(?:van )?{NAME}"
CITATION = re.compile(
    rf"\b(?P<first>{NAME})(?:(?:, | & ){LATER_NAME})*(?: et al\.)?(?:, {NAME}(?: {NAME})+)?(?:'s)? "
    r"\(?(?P<year>(?:1[89]|20)\d\d)\b"
)
NO_NAMES = {"The", "January", "June", "July"}  # "The 2015 paper", "June 2024"
ENTRY = re.compile(r"^@(?P<kind>\w+)\{(?P<key>\w+),\n(?P<fields>(?:  .*\n)+)\}$", flags=re.MULTILINE)
FIELD = re.compile(r"^  (\w+) = \{(.*)\},$", flags=re.MULTILINE)


def cited_in(text: str) -> set[tuple[str, str]]:
    """First author and year of every citation: "Saad & Schultz (1986)", "(Anderson et al. 1999)", …"""
    one_line = re.sub(r"\s*\n\s*#?\s*", " ", text)
    found = {(match["first"], match["year"]) for match in CITATION.finditer(one_line)}
    return {(name, year) for name, year in found if name not in NO_NAMES}


def entries() -> dict[str, dict[str, str]]:
    """Key -> fields of every entry."""
    text = BIBLIOGRAPHY.read_text(encoding="utf-8")
    matches = list(ENTRY.finditer(text))
    assert len(matches) == text.count("\n@"), "an entry is not written as the others are"
    keys = [match["key"] for match in matches]
    assert keys == sorted(set(keys)), "keys come once each, in the order of the alphabet"
    return {match["key"]: dict(FIELD.findall(match["fields"])) for match in matches}


def listed() -> set[tuple[str, str]]:
    """First author and year of every entry."""
    return {(fields["author"].split(",")[0], fields["year"]) for fields in entries().values()}


@pytest.mark.parametrize(
    ("text", "citations"),
    [
        ("by GMRES (Saad & Schultz 1986)", {("Saad", "1986")}),
        ("(Anderson et al. 1999). A reciprocal", {("Anderson", "1999")}),
        ("Jeffery's (1922) solution", {("Jeffery", "1922")}),
        ("relaxation: Mulder & van Leer 1985; Kelley\n    & Keyes 1998)", {("Mulder", "1985"), ("Kelley", "1998")}),
        ("Griewank & Walther, Evaluating Derivatives (2008), table 13.2", {("Griewank", "2008")}),
        ("Cochelin, Damil, Potier-Ferry (1994)", {("Cochelin", "1994")}),
        ("# so wrote (Moré, Garbow &\n# Hillstrom 1981)", {("Moré", "1981")}),
        ("as printed in the 2015 paper. The 2015 paper; aluminium 7075", set()),
    ],
)
def test_citations_are_found(text, citations):
    assert cited_in(text) == citations


def test_every_cited_work_is_in_the_bibliography():
    known = listed()
    missing = {
        f"{name} {year} in {path.relative_to(ROOT)}"
        for path in SOURCES
        for name, year in cited_in(path.read_text(encoding="utf-8")) - known
    }
    assert missing == set()


def test_the_citations_are_many():
    """A pattern that finds nothing would find nothing missing."""
    cited = set().union(*(cited_in(path.read_text(encoding="utf-8")) for path in SOURCES))
    assert {("Timesli", "2015"), ("Griewank", "2008"), ("Okabe", "2008"), ("Richardson", "1911")} <= cited
    assert len(cited) > 70


@pytest.mark.parametrize("key", entries())
def test_an_entry_says_who_what_and_when(key):
    fields = entries()[key]
    assert set(fields) >= {"author", "title", "year"}
    assert key.endswith(fields["year"])
    assert all(value.count("{") == value.count("}") for value in fields.values())


DOI = re.compile(r"10\.\d{4,9}/[^\s\"<>{}]+")
"""A digital object identifier (ISO 26324): the bare name, without the address that resolves it."""


@pytest.mark.parametrize("key", [key for key, fields in entries().items() if {"doi", "url"} & fields.keys()])
def test_an_entry_leads_somewhere_by_a_well_formed_name(key):
    fields = entries()[key]
    assert DOI.fullmatch(fields.get("doi", "10.1000/182"))
    assert fields.get("url", "https://").startswith("https://")


@pytest.mark.parametrize(
    "text", ["https://doi.org/10.1000/182", "10.1000", "10.1/2", "doi:10.1000/182", "10.1000/1 82"]
)
def test_what_is_no_identifier(text):
    assert not DOI.fullmatch(text)
