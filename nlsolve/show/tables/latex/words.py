r"""Text -> LaTeX that shows every letter of it, with an estimate of its width.

η becomes ``\ensuremath{\eta}``, x₁ becomes ``x\ensuremath{_{1}}``, 50 % becomes ``50 \%``. A letter that LaTeX cannot
print without further fonts becomes its number, ``{[}U+4E2D{]}``. All that is written is ASCII.
"""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import groupby

from nlsolve.show.tables.latex.letters import (
    LOWERED,
    MATHEMATICS,
    MATHEMATICS_ACCENTS,
    PLAIN,
    RAISED,
    TEXT_ACCENTS,
    TYPED,
)

NARROW, WIDE, WIDEST = set("ijl!'.,:;| []()fIrt/-₀₁₂₃₄₅₆₇₈₉⁰¹²³⁴⁵⁶⁷⁸⁹"), set("mw%&+=~≤≥≈×−→‖"), set("MW—")
WIDTHS = (3.4, 5.05, 7.4, 10.2)
"""Widths of narrow, usual (capital: the next), wide and widest letters of 10 pt [pt], rather too large."""

UNBROKEN = 24
"""Letters of a word that are kept together within a paragraph."""

MATHEMATICS_INSIDE = re.compile(r"\$[^$]*\$")
NUMBER = re.compile(r"[+-]?\d+(\.\d+)?(e[+-]?\d+)?")
"""What Python writes for a finite number."""


@dataclass(frozen=True)
class Words:
    """Words with spaces between: what each of them is in LaTeX, and its width at 10 pt [pt]."""

    tex: tuple[str, ...]
    widths: tuple[float, ...]

    def __add__(self, other: Words) -> Words:
        return Words(self.tex + other.tex, self.widths + other.widths)

    def closed_by(self, other: Words) -> Words:
        """These words and the other ones, no space between."""
        if not self.tex:
            return other
        tex = (*self.tex[:-1], self.tex[-1] + other.tex[0], *other.tex[1:])
        return Words(tex, (*self.widths[:-1], self.widths[-1] + other.widths[0], *other.widths[1:]))

    @property
    def width(self) -> float:
        """Width on one line."""
        return sum(self.widths) + WIDTHS[0] * max(len(self.widths) - 1, 0)

    @property
    def longest(self) -> float:
        """Width of the longest word."""
        return max(self.widths, default=0.0)

    @property
    def line(self) -> str:
        """The words on one line."""
        return " ".join(self.tex)

    def lines(self, limit: float) -> list[str]:
        """The words on lines no wider than the limit, but for longer words."""
        lines: list[list[str]] = []
        width = 0.0
        for tex, wide in zip(self.tex, self.widths, strict=True):
            if lines and width + WIDTHS[0] + wide <= limit:
                lines[-1].append(tex)
                width += WIDTHS[0] + wide
            else:
                lines.append([tex])
                width = wide
        return [" ".join(line) for line in lines]

    def within(self, limit: float) -> float:
        """Width of the text on lines no wider than the limit."""
        return self.width if self.width <= limit else max(self.longest, min(limit, self.width))


def of_text(text: str) -> Words:
    """The words of a text, whatever letters it has."""
    words = "".join(" " if _parts(letter) else letter for letter in text).split()
    return Words(tuple(map(escaped, words)), tuple(map(width_of, words)))


def of_paragraph(text: str) -> str:
    """A text that may be broken between words, and within those that are long."""
    found = []
    for word in "".join(" " if _parts(letter) else letter for letter in text).split():
        parts = re.findall(rf".{{1,{UNBROKEN}}}", word)
        found.append(r"\allowbreak{}".join(map(escaped, parts)))
    return " ".join(found)


def of_comparison(text: str) -> Words:
    """A number, one in parentheses, and words: "30 (32) within 25 %"."""
    found = Words((), ())
    for word in text.split():
        inside = word.removeprefix("(").removesuffix(")")
        if inside != word and NUMBER.fullmatch(inside):
            known = of_number(inside)
            found += Words((f"({known.tex[0]})",), (known.width + 2 * WIDTHS[0],))
        else:
            found += of_value(word)
    return found


def of_symbol(symbol: str) -> Words:
    r"""The words of a symbol of `nlsolve.results.columns`, in which $\|R\|_2$ is mathematics."""
    if "$" not in symbol:
        return of_text(symbol)
    words = re.findall(r"(?:\$[^$]*\$|[^\s$])+", symbol)
    widths = [4.0 + WIDTHS[1] * len(re.sub(r"\\[A-Za-z]+", "x", re.sub(r"[${}_^]", "", word))) for word in words]
    tex = [
        "".join(
            part if MATHEMATICS_INSIDE.fullmatch(part) else escaped(part) for part in re.split(r"(\$[^$]*\$)", word)
        )
        for word in words
    ]
    return Words(tuple(tex), tuple(widths))


def of_number(text: str) -> Words:
    """A number that Python has written, as mathematics: 2.7e-09 is 2.7 × 10⁻⁹, and 1e-06 is 10⁻⁶."""
    mantissa, _, exponent = text.partition("e")
    if not exponent:
        return Words((f"${mantissa}$",), (width_of(mantissa),))
    power = f"10^{{{int(exponent)}}}"
    plain = f"10{exponent}"
    if mantissa in ("1", "-1"):
        sign = mantissa.removesuffix("1")
        return Words((f"${sign}{power}$",), (width_of(sign + plain),))
    return Words((rf"${mantissa} \times {power}$",), (width_of(f"{mantissa} × {plain}"),))


def of_value(text: str) -> Words:
    """A number as mathematics, anything else as text."""
    return of_number(text) if NUMBER.fullmatch(text) else of_text(text)


def stacked(lines: Sequence[str], position: str, align: str) -> str:
    """Lines one above the other in a cell. position : "b" or "t", which of them is on the line of the row."""
    if len(lines) <= 1:
        return "".join(lines)
    return rf"\begin{{tabular}}[{position}]{{@{{}}{align}@{{}}}}" + r" \\ ".join(lines) + r"\end{tabular}"


def escaped(text: str) -> str:
    """A text in LaTeX, letter by letter."""
    return "".join(_joined(unicodedata.normalize("NFC", text)))


def width_of(text: str) -> float:
    """Width of a text at 10 pt [pt], as an estimate that is rather too large."""
    return sum(map(_width, unicodedata.normalize("NFC", text)))


def _parts(letter: str) -> bool:
    """Whether it is no letter but ends a line, or tells a printer something."""
    return unicodedata.category(letter) in ("Cc", "Zl", "Zp")


def _width(letter: str) -> float:
    if unicodedata.combining(letter):
        return 0.0
    if letter not in PLAIN and _known(letter) is None and len(unicodedata.normalize("NFD", letter)) == 1:
        return width_of(f"[U+{ord(letter):04X}]")
    kind = 0 if letter in NARROW else 2 if letter in WIDE or letter.isupper() else 3 if letter in WIDEST else 1
    return WIDTHS[kind]


def _joined(text: str) -> Iterator[str]:
    """LaTeX of each letter with its accents; of letters above or below the line together."""
    clusters = re.findall(r".[\u0300-\u036f\u20d0-\u20f0]*", text, re.DOTALL)
    for where, run in groupby(clusters, lambda cluster: next((w for w in "^_" if cluster in _level(w)), "")):
        letters = list(run)
        if where:
            yield rf"\ensuremath{{{where}{{{''.join(_level(where)[letter] for letter in letters)}}}}}"
            continue
        before = ""
        for letter in letters:
            yield r"{\kern0pt}" if letter == before and letter in "-',–—‐‑" else ""  # else TeX joins the two
            yield _cluster(letter)
            before = letter


def _level(where: str) -> dict[str, str]:
    return dict(RAISED if where == "^" else LOWERED)


def _cluster(cluster: str) -> str:
    """A letter with its accents."""
    whole = cluster if cluster[0] in PLAIN or _known(cluster[0]) else unicodedata.normalize("NFD", cluster)
    letter, accents = whole[0], whole[1:]
    known = letter if letter in PLAIN else _known(letter)
    if known is None:
        return "".join(f"{{[}}U+{ord(each):04X}{{]}}" for each in unicodedata.normalize("NFC", cluster))
    if not accents:
        return known
    text = letter.isascii() and letter.isalpha()
    if text and all(accent in TEXT_ACCENTS for accent in accents):
        found = rf"\{letter}" if letter in "ij" and accents[0] not in "\u0327\u0323\u0331" else letter
        for accent in accents:
            found = f"{TEXT_ACCENTS[accent]}{{{found}}}"
        return found
    found = MATHEMATICS.get(letter, rf"\mathrm{{{known}}}")
    for accent in accents:
        if accent not in MATHEMATICS_ACCENTS:
            return known + "".join(f"{{[}}U+{ord(each):04X}{{]}}" for each in accents)
        found = rf"{MATHEMATICS_ACCENTS[accent]}{{{found}}}"
    return rf"\ensuremath{{{found}}}"


def _known(letter: str) -> str | None:
    """LaTeX of a letter that is not plain; None where there is none."""
    if letter in TYPED:
        return TYPED[letter]
    if letter in MATHEMATICS:
        return rf"\ensuremath{{{MATHEMATICS[letter]}}}"
    for where in "^_":
        if letter in _level(where):
            return rf"\ensuremath{{{where}{{{_level(where)[letter]}}}}}"
    return None
