"""docs/tables.md tells the truth: its studies run, and print the LaTeX that it shows.

`.venv/bin/python tests/show/tables/test_page.py` writes the LaTeX anew.
"""

from __future__ import annotations

import re
import tomllib
from pathlib import Path

import pytest

import nlsolve
from nlsolve.show.tables import TableSpec

PAGE = Path(__file__).parents[3] / "docs" / "tables.md"
PAIR = re.compile(r"```toml\n(.*?)```\n\n```latex\n(.*?)```", re.DOTALL)


def typeset_as_shown(text: str) -> list[tuple[str, str]]:
    """For each pair of a declaration and its LaTeX on the page: what is shown, and what nlsolve writes."""
    declared = [tomllib.loads(study) for study, _ in PAIR.findall(text)]
    whole = declared[0]
    found = []
    for document, (_, shown) in zip(declared, PAIR.findall(text), strict=True):
        results = nlsolve.run({**whole, "table": document["table"]}, isolation="none")
        (table,) = results.tables()
        found.append((shown, table.latex()))
    return found


@pytest.fixture(scope="module")
def page() -> str:
    return PAGE.read_text(encoding="utf-8")


def test_the_page_shows_what_is_written(page):
    found = typeset_as_shown(page)
    assert len(found) == 2
    for shown, written in found:
        assert shown == written


def test_the_page_has_every_key_of_how(page):
    fields = [name for name in TableSpec.model_fields if name not in TableSpec.__mro__[1].model_fields]
    assert {f"`{name}`" for name in fields} <= set(re.findall(r"`\w+`", page))


if __name__ == "__main__":
    text = PAGE.read_text(encoding="utf-8")
    for (study, shown), (_, written) in zip(PAIR.findall(text), typeset_as_shown(text), strict=True):
        text = text.replace(
            f"```toml\n{study}```\n\n```latex\n{shown}```", f"```toml\n{study}```\n\n```latex\n{written}```"
        )
    PAGE.write_text(text, encoding="utf-8")
