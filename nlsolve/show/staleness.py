r"""Whether the tables and figures that a paper includes are those of a results folder."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path

from nlsolve.registry.problems import StudyError
from nlsolve.show.provenance import Noun, Written, written_in, written_in_picture

COMMENT = re.compile(r"(?<!\\)((?:\\\\)*)%.*")
INCLUSION = re.compile(r"\\(?:input|include|subfile)(?:\s*\{([^}]*)\}|\s+([^\s{}\\]+))")
PICTURE = re.compile(r"\\include(?:graphics|svg)\*?\s*(?:\[[^\]]*\]\s*)?\{([^}]*)\}")
PLACES = re.compile(r"\\graphicspath\s*\{((?:\s*\{[^}]*\})*)\s*\}")
ENDINGS = ("", ".pdf", ".png", ".svg")
"""What a picture may be called without, as LaTeX looks for it."""

Now = Callable[[Noun, str], str | None]
"""The digest of what a table or a figure of this name tells now; None where there is none."""


@dataclass(frozen=True)
class Included:
    """A table or a figure that a paper includes.

    file : the file it is in. reason : in what it differs from the results; empty where it does not.
    """

    file: Path
    noun: Noun
    name: str
    reason: str


def included(paper: Path, study: str, now: Now) -> list[Included]:
    r"""The tables and figures of a study that a paper has in itself or in what it includes, compared with the results.

    A picture that is not there is left to LaTeX, which finds others in places of its own.
    Raises StudyError for a paper or a file of it that cannot be read, and for a paper with nothing of the study.
    """
    found = [
        Included(file, written.noun, written.name, _reason(written, now))
        for file, written in _Paper(paper.parent).written(paper)
        if written.study == study
    ]
    if not found:
        raise StudyError(
            f"{paper}: no table or figure of the study {study!r} is in it or in what it includes; "
            r"\input{tables/NAME.tex}, with its comments, is one, and \includegraphics{figures/NAME.pdf} is another"
        )
    return found


def _reason(written: Written, now: Now) -> str:
    content = now(written.noun, written.name)
    if content is None:
        return f"the results have no such {written.noun} now"
    if written.content != content:
        return "stale, the results tell something else now"
    return "edited by hand since it was written" if written.edited else ""


@dataclass
class _Paper:
    """A paper in a folder: what was read of it, and where it has pictures."""

    root: Path
    seen: set[Path] = field(default_factory=set)
    pictures: list[Path] = field(default_factory=list)

    def written(self, file: Path) -> Iterator[tuple[Path, Written]]:
        """What nlsolve has written in a file and those that it includes, each of which is read once."""
        text = self._read(file).decode(errors="replace")
        for written in written_in(text):
            yield file, written
        text = "\n".join(COMMENT.sub(r"\1", line) for line in text.splitlines())
        for places in PLACES.findall(text):
            self.pictures += [self.root / place.strip() for place in re.findall(r"\{([^}]*)\}", places)]
        for braced, bare in INCLUSION.findall(text):
            name = (braced or bare).strip().strip('"')
            there = _first((self.root, file.parent), name, ("", ".tex"))
            if there is None and not name.startswith("\\"):
                raise StudyError(f"{file}: includes {name}, which is not there")
            if there is not None and there.resolve() not in self.seen:
                yield from self.written(there)
        for name in PICTURE.findall(text):
            there = _first((self.root, file.parent, *self.pictures), name.strip().strip('"'), ENDINGS)
            if there is not None and there.resolve() not in self.seen:
                for written in written_in_picture(self._read(there)):
                    yield there, written

    def _read(self, file: Path) -> bytes:
        self.seen.add(file.resolve())
        try:
            return file.read_bytes()
        except OSError as error:
            raise StudyError(f"{file}: cannot be read: {error.strerror}") from error


def _first(places: tuple[Path, ...], name: str, endings: tuple[str, ...]) -> Path | None:
    """The first file that a name may mean."""
    found = (place / f"{name}{ending}" for place in places for ending in endings)
    return next((path for path in found if path.is_file()), None)
