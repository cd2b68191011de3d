"""Fingerprints of the source by which a case is computed: nlsolve's numerics, and each package that it has a class of.

The rule:

nlsolve itself      counts by the files that compute, `NUMERICS`. Its commands, tables, figures and documentation do not
                    count, nor does its version: an edit of them runs nothing again.
any other package   counts whole: every file with source or machine code in it, and the version of its distribution
                    where it is found by an entry point of nlsolve (nlsolve's own packages of plugins have no version of
                    their own). A package counts for a case that has a component of one of its classes, or of a class
                    derived from one; a module that is a single file counts by this file.
a class without a file, as typed at a prompt, counts by the code of its methods.

Libraries (numpy, scipy, …) do not count: their versions are in the environment of every row.
"""

from __future__ import annotations

import hashlib
import sys
from collections.abc import Iterable, Iterator
from functools import cache
from importlib.metadata import entry_points
from pathlib import Path
from types import CodeType, FunctionType, ModuleType

from nlsolve.registry.installed.hookspecs import PROJECT

NUMERICS = ("series", "algebra", "contracts", "flow", "solving", "results/verdicts.py")
"""What of nlsolve computes numbers: files, and folders with all their files."""

NOT_COUNTED = sys.stdlib_module_names | {"pydantic"}
"""Packages whose classes are bases of components as the libraries' are."""

COUNTED = frozenset({".py", ".so", ".pyd"})
"""Suffixes of the files of a package that count."""

LETTERS = 12
"""Length of a fingerprint."""


def fingerprint(content: bytes) -> str:
    """A short digest of some bytes."""
    return hashlib.sha256(content).hexdigest()[:LETTERS]


@cache
def sources_of(cls: type) -> dict[str, str]:
    """Name -> version and fingerprint of every package that has a hand in a class.

    Looked up once for every class object, so that an edit after its import does not count as what was imported.
    """
    found: dict[str, str] = {}
    for base in cls.__mro__:
        top = base.__module__.partition(".")[0]
        if top == PROJECT:
            found[PROJECT] = numerics()
        elif top not in NOT_COUNTED:
            name, source = _package(top, base)
            found[name] = f"{_versions().get(top, '')} {source}".strip()
    return found


def numerics() -> str:
    """The fingerprint of nlsolve's own numerics."""
    return source_of(NUMERICS)


@cache
def source_of(names: tuple[str, ...]) -> str:
    """The fingerprint of these files and folders of nlsolve."""
    home = Path(__file__).parents[2]
    return _of_files(home, (path for name in names for path in _files(home / name)))


def _package(top: str, cls: type) -> tuple[str, str]:
    """Name and fingerprint of the package or file of a class; a file imported by another name has its own."""
    module = sys.modules.get(top)
    places = getattr(module, "__path__", None)
    if places:
        return top, fingerprint("".join(_of_files(Path(at), _files(Path(at))) for at in sorted(places)).encode())
    file = _file(sys.modules.get(cls.__module__), cls)
    if file is not None:
        return top if file.stem == top else file.name, fingerprint(file.read_bytes())
    return top, fingerprint("".join(_code(method.__code__) for method in _methods(cls)).encode())


def _file(module: ModuleType | None, cls: type) -> Path | None:
    """The file in which a class was written, if there is one."""
    names = [getattr(module, "__file__", None), *(method.__code__.co_filename for method in _methods(cls))]
    files = [Path(name) for name in names if name]
    return next((file for file in files if file.is_file()), None)


def _methods(cls: type) -> Iterator[FunctionType]:
    """The functions that were written in a class, not those that pydantic has added."""
    for _, value in sorted(vars(cls).items()):
        written = getattr(value, "fget", getattr(value, "__func__", value))
        if isinstance(written, FunctionType) and written.__module__ == cls.__module__:
            yield written


def _code(code: CodeType) -> str:
    """The instructions of a function, with the names and constants they use."""
    constants = [_code(value) if isinstance(value, CodeType) else repr(value) for value in code.co_consts]
    return f"{code.co_code.hex()}{code.co_names}{constants}"


def _files(place: Path) -> list[Path]:
    if place.is_file():
        return [place]
    return sorted(path for path in place.rglob("*") if path.suffix in COUNTED and path.is_file())


def _of_files(home: Path, files: Iterable[Path]) -> str:
    whole = hashlib.sha256()
    for path in files:
        content = path.read_bytes()
        whole.update(f"{path.relative_to(home).as_posix()}\0{len(content)}\0".encode() + content)
    return whole.hexdigest()[:LETTERS]


@cache
def _versions() -> dict[str, str]:
    """Top module of each plugin that an entry point names -> version of its distribution, nlsolve's own left out."""
    found = [(entry.module.partition(".")[0], entry.dist) for entry in entry_points(group=PROJECT)]
    return {top: dist.version for top, dist in found if dist is not None and dist.name != PROJECT}
