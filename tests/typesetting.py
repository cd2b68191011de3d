"""What the tests of typeset tables and figures need: a document, its engines, and what the log and the page say."""

from __future__ import annotations

import re
import shutil
import subprocess
import unicodedata
from collections.abc import Mapping, Sequence
from pathlib import Path

import pytest

from nlsolve.show.tables import PREAMBLE, PREAMBLE_FILE

ENGINES = ("pdflatex", "lualatex", "xelatex")
MOST = 1.0
"""How much wider than its line a box may be [pt]."""

OVERFULL = re.compile(r"Overfull \\hbox \((\d+\.\d+)pt too wide\)[^\n]*")


TABLES = ("siunitx.sty", "booktabs.sty", "pdflscape.sty")


def needs(engine: str, packages: Sequence[str] = TABLES) -> None:
    """Skip the test where an engine of TeX, or a package of it, is not installed."""
    if shutil.which(engine) is None:
        pytest.skip(f"{engine} is not installed")
    for name in packages:
        if not subprocess.run(["kpsewhich", name], capture_output=True, text=True).stdout.strip():
            pytest.skip(f"{name} is not installed for {engine}")


def typeset(folder: Path, texts: Mapping[str, str], engine: str, options: str = "") -> Path:
    """The document of some tables, a page each, by name of their files. Fails where TeX complains of anything."""
    folder.mkdir(parents=True, exist_ok=True)
    (folder / PREAMBLE_FILE).write_text(PREAMBLE, encoding="utf-8")
    for name, text in texts.items():
        (folder / f"{name}.tex").write_text(text, encoding="utf-8")
    body = "\n".join(rf"\input{{{name}.tex}}\clearpage" for name in texts)
    return compiled(folder, body, engine, options)


def compiled(folder: Path, body: str, engine: str, options: str = "") -> Path:
    """The document with this body, and with preamble.tex of the folder. Fails where TeX complains of anything.

    An overfull box of more than a point is a complaint, and so is a letter that no font has.
    """
    document = rf"\documentclass{options}{{article}}\input{{preamble}}\begin{{document}}{body}\end{{document}}"
    (folder / "document.tex").write_text(document, encoding="utf-8")
    ran = subprocess.run(
        [engine, "-interaction=nonstopmode", "-halt-on-error", "document.tex"], cwd=folder, capture_output=True
    )
    log = (folder / "document.log").read_text(encoding="utf-8", errors="replace")
    wrong = re.findall(r"^! [^\n]*\n[^\n]*\n[^\n]*", log, re.MULTILINE)
    assert ran.returncode == 0, f"{engine}: {wrong}"
    wide = [found[0] for found in OVERFULL.finditer(log) if float(found[1]) > MOST]
    assert wide == [], f"{engine}: {wide}"
    lost = re.findall(r"Missing character[^\n]*|Float too large[^\n]*", log)
    assert lost == [], f"{engine}: {lost}"
    return folder / "document.pdf"


def words_on(page: Path) -> str:
    """The letters of a document in its order, without spaces and lines, accents apart."""
    if shutil.which("pdftotext") is None:
        pytest.skip("pdftotext is not installed")
    text = subprocess.run(["pdftotext", "-raw", str(page), "-"], capture_output=True, check=True).stdout.decode()
    return letters_of(text)


ALIKE = {"ˆ": "^", "˜": "~", "’": "'", "‘": "`", "”": '"', "“": '"', "∥": "‖", "−": "-", "ϵ": "ε", "ϕ": "φ", "µ": "μ"}
"""Letters as the fonts of TeX call them -> as they were meant."""


def letters_of(text: str) -> str:
    """The letters of a text as they can be compared: one form of each, no spaces."""
    for letter, meant in ALIKE.items():
        text = text.replace(letter, meant)
    return "".join(letter for letter in unicodedata.normalize("NFKD", text) if not letter.isspace())


def as_letters(text: str, engine: str) -> str:
    """What is read of a text on the page: pdflatex draws an underscore as a line, lualatex reads ‖ as a k."""
    return letters_of({"pdflatex": text.replace("_", ""), "lualatex": text.replace("‖", "k")}.get(engine, text))
