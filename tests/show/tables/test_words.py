"""Text in LaTeX and Markdown: every letter is kept, nothing is a command, widths are about right."""

from __future__ import annotations

import re
import unicodedata

import pytest
from hypothesis import given
from hypothesis import strategies as st

from nlsolve.show.tables.latex.letters import LOWERED, MATHEMATICS, RAISED, TYPED
from nlsolve.show.tables.latex.words import (
    escaped,
    of_comparison,
    of_number,
    of_paragraph,
    of_symbol,
    of_text,
    of_value,
    stacked,
    width_of,
)
from nlsolve.show.tables.markdown import escaped as in_markdown

PRINTED = st.text(st.characters(min_codepoint=32, max_codepoint=126))

COMMANDS = sorted({**TYPED, **{letter: rf"\ensuremath{{{tex}}}" for letter, tex in MATHEMATICS.items()}}.items())


def read_back(tex: str) -> str:
    """The text that LaTeX prints: commands of letters of text read as letters."""
    for letter, command in sorted(TYPED.items(), key=lambda item: -len(item[1])):
        if letter.isascii():
            tex = tex.replace(command, f"\x00{ord(letter)}\x00")
    tex = tex.replace(r"{\kern0pt}", "")
    return re.sub(r"\x00(\d+)\x00", lambda found: chr(int(found[1])), tex)


@given(PRINTED)
def test_every_letter_of_a_keyboard_is_read_back(text):
    assert read_back(escaped(text)) == text


@given(st.text())
def test_whatever_is_written_is_ascii_and_its_braces_match(text):
    tex = escaped(text)
    assert tex.isascii()
    bare = re.sub(r"\\[{}]", "", tex)
    depth = [0]
    for letter in bare:
        depth.append(depth[-1] + {"{": 1, "}": -1}.get(letter, 0))
    assert min(depth) == 0 == depth[-1]


@given(st.text())
def test_nothing_is_special_but_what_is_escaped(text):
    r"""No comment, alignment, parameter, end of a row, or mathematics outside of \ensuremath."""
    tex = of_text(text).line
    bare = re.sub(r"\\[A-Za-z]+|\\[&%_#${}'`^~=.\"\|]", "", tex)
    assert not re.search(r"[&%#$~\"\n\\]", bare)
    assert "[" not in bare.replace("{[}", "")
    assert "`" not in bare
    outside = re.sub(r"\\ensuremath\{(?:[^{}]|\{(?:[^{}]|\{[^{}]*\})*\})*\}", "", tex)
    assert not re.search(r"(?<!\\)[_^](?!\{)", outside)


@given(st.text())
def test_no_letter_disappears(text):
    """Each letter is itself, a command, or its number; spaces and controls part words."""
    words = of_text(text)
    assert all(words.tex)
    assert all(width >= 0 for width in words.widths)
    kept = "".join(" " if unicodedata.category(letter) in ("Cc", "Zl", "Zp") else letter for letter in text).split()
    assert len(words.tex) == len(kept)


@pytest.mark.parametrize(("letter", "command"), COMMANDS)
def test_a_letter_has_its_command(letter, command):
    assert escaped(letter) == command


@pytest.mark.parametrize(
    ("text", "tex"),
    [
        ("y^2 ~x", r"y\textasciicircum{}2 \textasciitilde{}x"),
        (r"C:\new {50 %}", r"C:\textbackslash{}new \{50 \%\}"),
        ("en---em -- ''", r"en-{\kern0pt}-{\kern0pt}-em -{\kern0pt}- '{\kern0pt}'"),
        ("[x] *y", "{[}x{]} {*}y"),
        ("ε₀", r"\ensuremath{\varepsilon}\ensuremath{_{0}}"),
        ("10⁻⁹", r"10\ensuremath{^{-9}}"),
        ("ε̇ and ε̄", r"\ensuremath{\dot{\varepsilon}} and \ensuremath{\bar{\varepsilon}}"),
        ("naïve Ångström", r"na\"{\i}ve \r{A}ngstr\"{o}m"),
        ("𝑝 ≠ 2", r"\ensuremath{p} \ensuremath{\neq} 2"),
        ("Α", r"\ensuremath{\mathrm{A}}"),
        ("中", "{[}U+4E2D{]}"),
        ("x\u0489", "x{[}U+0489{]}"),
    ],
)
def test_texts(text, tex):
    assert escaped(text) == tex


def test_a_sign_above_or_below_the_line_is_raised_or_lowered_once():
    assert {escaped(letter) for letter in RAISED} == {rf"\ensuremath{{^{{{tex}}}}}" for tex in RAISED.values()}
    assert {escaped(letter) for letter in LOWERED} == {rf"\ensuremath{{_{{{tex}}}}}" for tex in LOWERED.values()}


@pytest.mark.parametrize(
    ("text", "tex"),
    [
        ("20", "$20$"),
        ("-3.5", "$-3.5$"),
        ("1e-06", "$10^{-6}$"),
        ("-1e+20", "$-10^{20}$"),
        ("4.7e-10", r"$4.7 \times 10^{-10}$"),
    ],
)
def test_numbers(text, tex):
    assert of_number(text).line == tex
    assert of_value(text) == of_number(text)


def test_only_a_number_is_mathematics():
    assert of_value("1e-06 s").line == "1e-06 s"
    assert of_comparison("3e-09 (4e-09) within 25 %").line == (
        r"$3 \times 10^{-9}$ ($4 \times 10^{-9}$) within $25$ \%"
    )


def test_a_symbol_keeps_its_mathematics():
    assert of_symbol(r"$\|R\|_2$ of x_1").line == r"$\|R\|_2$ of x\_1"
    assert of_symbol(r"a step $\Delta t$").tex == ("a", "step", r"$\Delta t$")
    assert of_symbol("relative residual") == of_text("relative residual")


@given(st.text(), st.floats(1.0, 200.0))
def test_lines_hold_all_words_within_their_limit(text, limit):
    words = of_text(text)
    lines = words.lines(limit)
    assert " ".join(lines) == words.line
    assert words.within(limit) <= max(limit, words.longest) + 1e-9


def test_lines_above_one_another():
    assert stacked(["a"], "b", "c") == "a"
    assert stacked(["a", "b"], "t", "l") == r"\begin{tabular}[t]{@{}l@{}}a \\ b\end{tabular}"


def test_a_long_word_of_a_paragraph_may_be_broken():
    assert of_paragraph("x" * 30 + " y") == "x" * 24 + r"\allowbreak{}" + "x" * 6 + " y"


@pytest.mark.parametrize(
    ("text", "points"),
    [("modified newton", 72.5), ("generalized-rosenbrock", 98.5), ("time inside the method [s]", 114.3)],
)
def test_widths_are_those_of_computer_modern(text, points):
    """Widths that LaTeX measured; the estimate may be a tenth too large."""
    assert points <= 1.01 * of_text(text).width <= 1.1 * points
    assert width_of("") == 0.0


# Markdown.

MARKDOWN = re.compile(r"\\([\\|`*\[\]<>$~_&])")


@given(PRINTED)
def test_markdown_is_read_back_and_keeps_its_columns(text):
    cell = in_markdown(text)
    assert MARKDOWN.sub(r"\1", cell) == " ".join(text.split())
    assert not re.search(r"(?<!\\)\|", cell)


def test_markdown_leaves_names_alone():
    assert in_markdown("triangular_solves") == "triangular_solves"
    assert in_markdown("_x_ <b> a|b &amp; & \n c") == r"\_x\_ \<b\> a\|b \&amp; & c"
    assert in_markdown("[s] [a](b) [^1]") == r"[s] [a\](b) \[^1]"
