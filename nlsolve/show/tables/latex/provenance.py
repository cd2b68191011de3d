"""What a table in LaTeX says of itself in comments: study, date, version, command, packages, and two digests.

One digest is of what the table tells, another of its text, by which an edit is seen. The date is part of neither.
"""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import dataclass

from nlsolve.show.tables.latex.floats import packages_of
from nlsolve.show.tables.latex.grid import digest_of
from nlsolve.show.tables.spec import TableSpec

BEGIN, END = "% nlsolve: ", "% nlsolve: end"


@dataclass(frozen=True)
class Provenance:
    """Where tables come from.

    study : name of the study. command : what runs it, empty where Python did.
    version, day : nlsolve's version, and the day on which the tables are written.
    """

    study: str
    command: str
    version: str
    day: str

    def around(self, spec: TableSpec, digest: str, body: str) -> str:
        """The text of a table between comments. digest : of what it tells."""
        by = f"by {self.command}" if self.command else "from Python"
        mark = {"table": spec.name, "study": self.study, "content": digest, "text": digest_of(body)}
        lines = (
            f"Table {spec.name} of the study {self.study}, written {by}",
            f"with nlsolve {self.version} on {self.day}.",
            f"Needs \\usepackage{{{', '.join(packages_of(spec))}}}: see preamble.tex beside it.",
        )
        comments = [f"% {' '.join(line.split())}" for line in lines]
        return "\n".join((*comments, BEGIN + json.dumps(mark), f"{body}{END}", ""))


@dataclass(frozen=True)
class Written:
    """A table in LaTeX as a file holds it.

    content : the digest of what it told when it was written. edited : whether its text has been changed since.
    """

    table: str
    study: str
    content: str
    edited: bool


def written_in(text: str) -> Iterator[Written]:
    """The tables in a text that nlsolve has written, with their comments."""
    lines = text.splitlines()
    for number, line in enumerate(lines):
        if not line.startswith(BEGIN) or line.rstrip() == END:
            continue
        try:
            mark = json.loads(line.removeprefix(BEGIN))
            table, study, content, digest = (mark[name] for name in ("table", "study", "content", "text"))
        except (ValueError, TypeError, KeyError):
            continue  # a comment that was edited says nothing
        body = []
        for after in lines[number + 1 :]:
            if after.startswith(BEGIN.rstrip()):
                break
            body.append(after)
        yield Written(str(table), str(study), str(content), digest_of("\n".join(body)) != digest)
