"""The files that a study file names by paths relative to itself: plugins, and the study that it extends."""

from __future__ import annotations

import posixpath
import tomllib
from collections.abc import Mapping
from pathlib import Path, PurePosixPath
from typing import Any

from nlsolve.study.documents import EXTENDS, PLUGINS

PLACED = "beside"
"""Folder of the files that are not within the folder of the study."""


class StudyFiles:
    """A study file and all that it names, under paths of one folder.

    texts : path -> text of every study file; what a path led out of the folder to is named anew in it.
    plugins : path -> the file of every plugin.
    missing : what is named in a way that could not be changed.
    """

    def __init__(self, path: Path, name: str) -> None:
        self.texts: dict[str, str] = {}
        self.plugins: dict[str, Path] = {}
        self.missing: list[Path] = []
        self._placed: dict[Path, str] = {}
        self._add_study(path, PurePosixPath(name))

    def add_plugin(self, path: Path) -> str:
        """Add a plugin that no study names; returns its path in the folder."""
        target = self._place(path)
        self.plugins[target] = path
        return target

    def _add_study(self, path: Path, at: PurePosixPath) -> None:
        text = path.read_text(encoding="utf-8-sig")
        document = tomllib.loads(text)
        named = {raw: False for raw in document.get(PLUGINS, [])} | _extended(document)
        for raw, is_study in named.items():
            source = path.parent / raw
            inside = posixpath.normpath((at.parent / raw).as_posix())
            target = inside
            if Path(raw).is_absolute() or inside.startswith(".."):
                target = self._place(source)
                changed = _renamed(text, raw, posixpath.relpath(target, at.parent.as_posix()))
                if changed == text:
                    self.missing.append(source)
                    continue
                text = changed
            if is_study:
                self._add_study(source, PurePosixPath(target))
            else:
                self.plugins[target] = source
        self.texts[at.as_posix()] = text

    def _place(self, source: Path) -> str:
        """Where a file from outside goes: each under its own name, which is part of what tells plugins apart."""
        file = source.resolve()
        if file not in self._placed:
            taken = [path for path in self._placed if path.name == file.name]
            folder = f"{PLACED}-{len(taken) + 1}" if taken else PLACED
            self._placed[file] = f"{folder}/{file.name}"
        return self._placed[file]


def _extended(document: Mapping[str, Any]) -> dict[str, bool]:
    return {document[EXTENDS]: True} if EXTENDS in document else {}


def _renamed(text: str, old: str, new: str) -> str:
    """A text in which a quoted word is another one."""
    for quote in ('"', "'"):
        text = text.replace(f"{quote}{old}{quote}", f"{quote}{new}{quote}")
    return text
