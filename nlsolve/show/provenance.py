"""What a table in LaTeX or a picture says of itself: study, date, version, command, and a digest of what it tells.

A text says so in comments, with another digest, of itself, by which an edit is seen; a picture in its metadata. The
date is part of neither digest.
"""

from __future__ import annotations

import hashlib
import html
import json
import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from datetime import date
from importlib import metadata
from typing import Any, Literal

Noun = Literal["table", "figure"]

BEGIN, END = "% nlsolve: ", "% nlsolve: end"
IN_PICTURE = "nlsolve: "
"""Stands before the mark in the metadata of a picture."""

DIGITS = 16
"""Digits of a digest."""

LONGEST = 4000
"""Bytes in which the mark of a picture is looked for, from its beginning on."""


def digest_of(text: str) -> str:
    """A digest of a text, whatever its lines end with."""
    lines = "\n".join(line.rstrip() for line in text.strip().splitlines())
    return hashlib.sha256(lines.encode()).hexdigest()[:DIGITS]


def version_of(distribution: str) -> str:
    """The version that is installed."""
    try:
        return metadata.version(distribution)
    except metadata.PackageNotFoundError:  # run from a checkout that is not installed
        return "(not installed)"


@dataclass(frozen=True)
class Provenance:
    """Where tables and figures come from.

    study : name of the study. command : what runs it, empty where Python did.
    version, day : nlsolve's version, and the day on which they are written.
    """

    study: str
    command: str
    version: str
    day: str

    @classmethod
    def today(cls, study: str, command: str) -> Provenance:
        """What this nlsolve writes today."""
        return cls(study, command, version_of("nlsolve"), date.today().isoformat())

    def of(self, noun: Noun, name: str, digest: str) -> Mark:
        """What one table or figure says. digest : of what it tells."""
        return Mark(self, noun, name, digest)


@dataclass(frozen=True)
class Mark:
    """What a table or a figure says of itself. content : the digest of what it tells."""

    provenance: Provenance
    noun: Noun
    name: str
    content: str

    @property
    def lines(self) -> tuple[str, str]:
        """Where it comes from, in words."""
        made = self.provenance
        by = f"by {made.command}" if made.command else "from Python"
        first = f"{self.noun.capitalize()} {self.name} of the study {made.study}, written {by}"
        return " ".join(first.split()), f"with nlsolve {made.version} on {made.day}."

    def around(self, body: str, packages: Sequence[str]) -> str:
        """A text in LaTeX between comments. packages : what it needs."""
        needs = f"Needs \\usepackage{{{', '.join(packages)}}}: see preamble.tex beside it."
        comments = [f"% {line}" for line in (*self.lines, needs)]
        return "\n".join((*comments, BEGIN + self._json(text=digest_of(body)), f"{body.rstrip()}\n{END}", ""))

    def metadata(self, form: str) -> dict[str, Any]:
        """What matplotlib writes into a picture of the format png, pdf or svg."""
        words, mark = {"png": ("Description", "Comment"), "pdf": ("Subject", "Keywords")}.get(
            form, ("Description", "Keywords")
        )
        return {words: " ".join(self.lines), mark: IN_PICTURE + self._json()}

    def _json(self, **more: str) -> str:
        return json.dumps({self.noun: self.name, "study": self.provenance.study, "content": self.content, **more})


@dataclass(frozen=True)
class Written:
    """A table in LaTeX or a figure as a file holds it.

    content : the digest of what it told when it was written. edited : whether its text has been changed since.
    """

    noun: Noun
    name: str
    study: str
    content: str
    edited: bool = False


def written_in(text: str) -> Iterator[Written]:
    """The tables and figures in a text that nlsolve has written, with their comments."""
    lines = text.splitlines()
    for number, line in enumerate(lines):
        if not line.startswith(BEGIN) or line.rstrip() == END:
            continue
        try:
            mark = json.loads(line.removeprefix(BEGIN))
            digest = mark["text"]
        except (ValueError, TypeError, KeyError):
            continue  # a comment that was edited says nothing
        body = []
        for after in lines[number + 1 :]:
            if after.startswith(BEGIN.rstrip()):
                break
            body.append(after)
        yield from _written(mark, digest_of("\n".join(body)) != digest)


def written_in_picture(content: bytes) -> Iterator[Written]:
    """The figure whose picture is in a PNG, PDF or SVG, if nlsolve has written it."""
    start = content.find(f"{IN_PICTURE}{{".encode())
    if start < 0:
        return
    text = content[start + len(IN_PICTURE) : start + LONGEST].decode("latin-1")
    if content.startswith(b"%PDF"):
        text = re.sub(r"\\(.)", r"\1", text)
    elif not content.startswith(b"\x89PNG"):
        text = html.unescape(text)
    try:
        mark, _ = json.JSONDecoder().raw_decode(text)
    except ValueError:
        return  # metadata that were edited say nothing
    yield from _written(mark, False)


def _written(mark: Any, edited: bool) -> Iterator[Written]:
    """What a mark says; nothing where it is not one."""
    nouns: tuple[Noun, ...] = ("table", "figure")
    for noun in nouns:
        if isinstance(mark, dict) and {noun, "study", "content"} <= mark.keys():
            yield Written(noun, str(mark[noun]), str(mark["study"]), str(mark["content"]), edited)
