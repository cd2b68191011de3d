r"""Whether the tables that a paper includes are those of a results folder."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

from nlsolve.registry.problems import StudyError
from nlsolve.show.tables.latex.provenance import Written, written_in

COMMENT = re.compile(r"(?<!\\)((?:\\\\)*)%.*")
INCLUSION = re.compile(r"\\(?:input|include|subfile)(?:\s*\{([^}]*)\}|\s+([^\s{}\\]+))")


@dataclass(frozen=True)
class Included:
    """A table that a paper includes.

    file : the file it is in. reason : in what it differs from the results; empty where it does not.
    """

    file: Path
    table: str
    reason: str


def included_tables(paper: Path, study: str, digests: Mapping[str, str]) -> list[Included]:
    r"""The tables of a study that a paper has in itself or in what it includes, each compared with the results.

    digests : name of a table -> digest of what it tells now.
    Raises StudyError for a paper or a file of it that cannot be read, and for a paper without tables of the study.
    """
    found = [
        Included(file, table.table, _reason(table, digests))
        for file, text in _texts(paper, paper.parent, set())
        for table in written_in(text)
        if table.study == study
    ]
    if not found:
        raise StudyError(
            f"{paper}: no table of the study {study!r} is in it or in what it includes; "
            r"\input{tables/NAME.tex}, with its comments, is one"
        )
    return found


def _reason(table: Written, digests: Mapping[str, str]) -> str:
    if table.table not in digests:
        return "the results have no such table now"
    if table.content != digests[table.table]:
        return "stale, the results tell something else now"
    return "edited by hand since it was written" if table.edited else ""


def _texts(file: Path, root: Path, seen: set[Path]) -> Iterator[tuple[Path, str]]:
    """A file and those that it includes, each once, with their texts."""
    if file.resolve() in seen:
        return
    seen.add(file.resolve())
    try:
        text = file.read_text(encoding="utf-8", errors="replace")
    except OSError as error:
        raise StudyError(f"{file}: cannot be read: {error.strerror}") from error
    yield file, text
    for line in text.splitlines():
        for braced, bare in INCLUSION.findall(COMMENT.sub(r"\1", line)):
            name = (braced or bare).strip().strip('"')
            places = [place / f"{name}{ending}" for place in (root, file.parent) for ending in ("", ".tex")]
            there = next((place for place in places if place.is_file()), None)
            if there is not None:
                yield from _texts(there, root, seen)
            elif not name.startswith("\\"):
                raise StudyError(f"{file}: includes {name}, which is not there")
