"""The gallery: the pictures that the program draws of the shipped studies.

    python docs/gallery.py                       # the quick form of each study that draws any, minutes
    python docs/gallery.py --full                # each in full, days
    python docs/gallery.py first paper/figures   # these only

Pictures are kept in build/gallery, as results folders are: what is there is not computed again. As an extension of
Sphinx, this module adds them to the page gallery.md; of a study without pictures the page says how they are drawn.
"""

from __future__ import annotations

import argparse
import tomllib
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from typing import Any

import nlsolve

ROOT = Path(__file__).parent.parent
STUDIES = ROOT / "studies"
DRAWN = ROOT / "build" / "gallery"
PAGE = "gallery"


@cache
def studies() -> dict[str, nlsolve.Study]:
    """The shipped studies that draw figures, by name: "first", "paper/figures"."""
    declared = [path for path in sorted(STUDIES.rglob("*.toml")) if "figure" in tomllib.loads(path.read_text("utf-8"))]
    return {path.relative_to(STUDIES).with_suffix("").as_posix(): nlsolve.Study.from_toml(path) for path in declared}


def folder(name: str, full: bool) -> Path:
    """The results folder of a study."""
    return DRAWN / ("full" if full else "quick") / name


def draw(names: list[str], full: bool) -> None:
    """Run studies, which draws their figures."""
    for name in names:
        results = nlsolve.run(STUDIES / f"{name}.toml", folder(name, full), quick=not full)
        print(f"{name}: {len(results.runs)} cases, figures in {folder(name, full) / 'figures'}")
        for note in results.notes:
            print(f"  {note}")


def page() -> Iterator[str]:
    """A section for each study, in Markdown: its question, and its pictures with their captions."""
    for name, study in studies().items():
        yield f"## studies/{name}.toml\n\n{study.question}\n"
        full = (folder(name, True) / "figures").exists()
        if not full and not (folder(name, False) / "figures").exists():
            yield f"Not drawn in this copy of the site: `python docs/gallery.py {name}` draws it.\n"
            continue
        yield "In full.\n" if full else "Quick form: a small part of the study, on few nodes.\n"
        for figure in study.figures:
            picture = folder(name, full) / "figures" / f"{figure.name}.png"
            if picture.exists():
                caption = " ".join((figure.caption or figure.name).split())
                where = Path("..") / picture.relative_to(ROOT)
                yield f"```{{figure}} {where.as_posix()}\n:alt: {caption}\n\n{caption}\n```\n"


def add(app: Any, name: str, source: list[str]) -> None:
    """Add the sections to the page."""
    if name == PAGE:
        source[0] += "\n" + "\n".join(page())


def setup(app: Any) -> dict[str, bool]:
    """Called by Sphinx."""
    app.connect("source-read", add)
    return {"parallel_read_safe": True}


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description="draw the pictures of the shipped studies")
    parser.add_argument("names", nargs="*", help="studies, such as first or paper/figures; default: all that draw any")
    parser.add_argument("--full", action="store_true", help="in full, not in the quick form")
    given = parser.parse_args()
    draw(given.names or list(studies()), given.full)
