"""What determines the numbers of a case: its validated parameters, the files it reads, and the source it runs.

Names of tables and settings, the question, the order of sweeps and the other cases of a study have no part in it.
"""

from __future__ import annotations

import json
from collections.abc import Collection, Iterable, Mapping
from dataclasses import asdict, dataclass
from functools import cache, cached_property
from pathlib import Path
from typing import Any

from nlsolve.registry.installed.hookspecs import PROJECT
from nlsolve.running.store.sources import fingerprint, sources_of
from nlsolve.study.case import Case
from nlsolve.study.known_parts import KnownPart, classes_of

MISSING = "missing"
"""Stands for the content of a file that cannot be read; when it can be, the case is another one."""


@dataclass(frozen=True)
class Identity:
    """What determines the numbers of a case.

    case : digest of its validated parameters, all defaults filled in.
    code : package -> version and fingerprint of its source; see `nlsolve.running.store.sources`.
    files : path -> fingerprint of the contents of each file that a component reads.
    """

    case: str
    code: Mapping[str, str]
    files: Mapping[str, str]

    @cached_property
    def key(self) -> str:
        """The name of a part: CASE-REST, with one digest of code and files."""
        return f"{self.case}-{_digest(tuple(self.code.items()), tuple(self.files.items()))}"

    def plain(self) -> dict[str, Any]:
        """The identity as JSON values."""
        return asdict(self)

    def changes_since(self, old: Identity) -> tuple[str, ...]:
        """What differs between two identities of one case: "changed plugin honey 1.0 -> 1.1", "changed file a.csv"."""
        told = [
            f"changed {'' if name == PROJECT else 'plugin '}{name}{_versions(was, now)}"
            for name, was, now in _differing(old.code, self.code)
        ]
        return (*told, *(f"changed file {name}" for name, _, _ in _differing(old.files, self.files)))


def case_of(key: str) -> str:
    """The case that a part's name begins with."""
    return key.partition("-")[0]


def identity_of(case: Case) -> Identity:
    """The identity of a case as it would be run now."""
    return _identity(case.id, case.known.values())


def way_of(case: Case) -> str:
    """The name of a case's way to its first state; cases of one name share it. Empty: it has none."""
    return _identity(case.way_id, [case.known[name] for name in case.way]).key if case.way else ""


def _identity(name: str, parts: Collection[KnownPart]) -> Identity:
    classes = frozenset[type]().union(*(part.classes for part in parts))
    files = {path: _content(path) for part in parts for path in part.files}
    return Identity(name, _code_of(classes), dict(sorted(files.items())))


def code_of(sections: Iterable[Any]) -> dict[str, str]:
    """Package -> version and fingerprint of its source, for the classes of these components at any depth."""
    return dict(_code_of(frozenset[type]().union(*map(classes_of, sections))))


@cache
def _code_of(classes: frozenset[type]) -> Mapping[str, str]:
    found: dict[str, str] = {}
    for cls in classes:
        found |= sources_of(cls)
    return dict(sorted(found.items()))


@cache
def _digest(code: tuple[tuple[str, str], ...], files: tuple[tuple[str, str], ...]) -> str:
    """One digest of code and files, which most cases of a study have in common."""
    return fingerprint(json.dumps([dict(code), dict(files)], sort_keys=True).encode())


_contents: dict[tuple[str, int, int], str] = {}


def _content(name: str) -> str:
    """The fingerprint of a file's contents, computed once while neither its time nor its size changes."""
    path = Path(name)
    try:
        found = path.stat()
        key = (str(path.resolve()), found.st_mtime_ns, found.st_size)
        if key not in _contents:
            _contents[key] = fingerprint(path.read_bytes())
    except OSError:  # not there, or a folder: the case will say so in its row
        return MISSING
    return _contents[key]


def _differing(old: Mapping[str, str], new: Mapping[str, str]) -> list[tuple[str, str, str]]:
    names = sorted({*old, *new})
    return [(name, old.get(name, ""), new.get(name, "")) for name in names if old.get(name) != new.get(name)]


def _versions(was: str, now: str) -> str:
    """ " 1.0 -> 1.1", or nothing where the version is the same or there is none."""
    before, after = (text.rpartition(" ")[0] for text in (was, now))
    return f" {before} -> {after}" if before != after else ""
