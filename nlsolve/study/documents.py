"""A study file as a document, merged over the study that it extends, and where each value of it was written."""

from __future__ import annotations

import json
import re
import shlex
import tomllib
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from nlsolve.registry.problems import Problem, Source, StudyError
from nlsolve.registry.toml_lines import Place, lines_of
from nlsolve.study.sweeps import Document, merged

EXTENDS, PLUGINS = "extends", "plugins"
"""Entries whose paths are relative to the file that they are written in."""


def read_document(path: Path, above: tuple[Path, ...] = ()) -> tuple[Document, Source]:
    """The document of a study file, its own entries merged over those of the study that it extends: tables key by key,
    while a table with a kind, a list and any other value replace what was there.

    above : the files that extend this one. Raises StudyError for a file that cannot be read.
    """
    document, source = _parsed(path)
    _resolve_plugins(document, path.parent)
    if EXTENDS not in document:
        return document, source
    value = document.pop(EXTENDS)
    if not (isinstance(value, str) and value):
        raise StudyError(_told(source, value, "should be the path of a study, relative to this one"))
    circle = (*above, path.resolve())
    base = path.parent / value
    if base.resolve() in circle:
        names = " extends ".join(file.name for file in (*circle, base))
        raise StudyError(_told(source, value, f"studies cannot extend one another in a circle: {names}"))
    if not base.is_file():
        raise StudyError(_told(source, value, f"there is no file {base}"))
    older, written = read_document(base, circle)
    return merged(older, document), _over(source, document, written, older)


def _told(source: Source, value: Any, expected: str) -> str:
    return Problem((EXTENDS,), value, expected).sentence(source)


def _parsed(path: Path) -> tuple[Document, Source]:
    try:
        text = path.read_text(encoding="utf-8-sig")  # editors put a mark before the first byte
        document = tomllib.loads(text)
    except OSError as error:
        raise StudyError(f"{path}: the study cannot be read: {error.strerror}") from error
    except UnicodeDecodeError as error:
        line = 1 + error.object[: error.start].count(b"\n")
        raise StudyError(f"{path}, line {line}: the study is not UTF-8 text: {error.reason}") from error
    except tomllib.TOMLDecodeError as error:
        raise StudyError(_syntax(str(path), str(error))) from error
    return document, Source(str(path), lines_of(text))


def _syntax(path: str, message: str) -> str:
    found = re.search(r"\(at line (\d+), column (\d+)\)", message)
    where = f", line {found[1]}, column {found[2]}" if found else ""
    return f"{path}{where}: not valid TOML: {message.split(' (at ')[0]}"


def _resolve_plugins(document: Document, folder: Path) -> None:
    paths = document.get(PLUGINS)
    if isinstance(paths, list) and all(isinstance(path, str) for path in paths):
        document[PLUGINS] = [str(folder / path) for path in paths]


def _over(own: Source, document: Document, base: Source, older: Document) -> Source:
    """Where the values of a merged document were written; the places of values that were replaced are forgotten."""
    replaced = set(_replaced(document, older))
    kept = {place: line for place, line in base.lines.items() if not _is_inside(place, replaced)}
    files = {place: base.files.get(place, base.file) for place in kept if place not in own.lines}
    return replace(own, lines={**kept, **own.lines}, files=files)


def _replaced(new: Mapping[str, Any], old: Mapping[str, Any], above: Place = ()) -> Iterator[Place]:
    """The places of the values that `new` does not merge into `old`."""
    for name, value in new.items():
        place, before = (*above, name), old.get(name)
        if isinstance(value, Mapping) and "kind" not in value and isinstance(before, Mapping):
            yield from _replaced(value, before, place)
        else:
            yield place


def _is_inside(place: Place, places: set[Place]) -> bool:
    return any(place[:length] in places for length in range(1, len(place) + 1))


def command_of(path: str | Path, overrides: Mapping[str, Any], quick: bool, plugins: Sequence[Path]) -> str:
    """What runs the study of a file with these settings and plugins of one file."""
    settings = [f"{name}={json.dumps(value, ensure_ascii=False, default=str)}" for name, value in overrides.items()]
    given = (("--set", settings), ("--plugin", map(str, plugins)))
    options = [word for option, values in given for value in values for word in (option, value)]
    return shlex.join(["nlsolve", "run", str(path), *options, *["--quick"] * quick])
