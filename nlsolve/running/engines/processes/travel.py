"""What goes between the runner and a worker process: cases on the way there, progress and parts on the way back."""

from __future__ import annotations

import io
import pickle
import sys
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from importlib.util import find_spec, module_from_spec, spec_from_file_location
from types import SimpleNamespace
from typing import Any

from nlsolve.contracts.component import Component
from nlsolve.results.frames import Part
from nlsolve.running.engines.places import components_in, named
from nlsolve.running.store.identity import code_of
from nlsolve.solving.way import Way
from nlsolve.study.case import Case
from nlsolve.study.limits import Limits
from nlsolve.study.timing import Timing


class NotPortable(Exception):
    """A component cannot be made in another process; the message is a sentence that names it and says why."""


class Sections(SimpleNamespace):
    """The component of each section under its name, as a case has them."""

    def __iter__(self) -> Iterator[tuple[str, Any]]:
        return iter(vars(self).items())


@dataclass(frozen=True)
class Task:
    """A case on its way to a worker.

    sections : each component, pickled by itself, so that the one that fails can be named.
    lane : where its seconds come from.
    files : module -> its file, for the modules of the components, which need not be installed.
    way : the way to its first state, where another case has solved it.
    code : package -> version and fingerprint of its source, as `code_of` the components, where they must be the same.
    """

    case: str
    parameters: Mapping[str, Any]
    sections: Mapping[str, bytes]
    files: Mapping[str, str]
    limits: Limits
    timing: Timing
    lane: str
    way: Way | None = None
    code: Mapping[str, str] = field(default_factory=dict)

    def parts(self) -> Sections:
        """The components of the case. Raises NotPortable for one that this process cannot import, or has otherwise."""
        for module, file in self.files.items():
            _load(module, file)
        found = {name: _unpacked(name, data) for name, data in self.sections.items()}
        here = code_of(found.values()) if self.code else {}
        for name, source in self.code.items():
            if here.get(name) != source:
                raise NotPortable(f"{name} is {here.get(name, 'missing')} there and {source} here")
        return Sections(**found)


@dataclass(frozen=True)
class Ready:
    """A worker can take a task.

    threads : of each BLAS and OpenMP library that has more than one, by its name.
    """

    threads: Mapping[str, int]


@dataclass(frozen=True)
class Warm:
    """A worker has run a case for the first time, of which nothing is kept; the run that counts begins."""


@dataclass(frozen=True)
class Ended:
    """A case has ended.

    changed : what it has left changed in its process, which must not serve another case; empty: nothing.
    imported : how long its components took to be imported [s].
    """

    part: Part
    changed: str
    imported: float = 0.0


@dataclass(frozen=True)
class Unreadable:
    """A worker could not import the components of a case; `reason` is a sentence."""

    reason: str


def packed(case: Case, timing: Timing, lane: str, way: Way | None = None) -> Task:
    """The task of a case. Raises NotPortable when a component cannot be pickled, or is of the running script's own."""
    sections = {name: _packed(name, value) for name, value in case.parts}
    modules = {type(component).__module__ for component in components_in(value for _, value in case.parts)}
    files = {name: getattr(sys.modules.get(name), "__file__", None) for name in sorted(modules)}
    known = {name: file for name, file in files.items() if file is not None}
    return Task(case.id, dict(case.parameters), sections, known, case.parts.limits, timing, lane, way)


class _Pickler(pickle.Pickler):
    """Refuses what is defined in the running script: another process would have to run the script to have it."""

    def reducer_override(self, value: Any) -> Any:
        if getattr(value, "__module__", None) == "__main__" and hasattr(value, "__qualname__"):
            raise pickle.PicklingError(f"{value.__qualname__} is defined in the script that runs")
        return NotImplemented


def _packed(name: str, value: Any) -> bytes:
    data = io.BytesIO()
    try:
        _Pickler(data, pickle.HIGHEST_PROTOCOL).dump(value)
    except Exception as error:  # a stranger's component may raise anything
        words = named(value) if isinstance(value, Component) and value.noun == name else f"the section {name!r}"
        raise NotPortable(f"{words} cannot go to another process ({error})") from error
    return data.getvalue()


def _load(module: str, file: str) -> None:
    """Import a module from its file where it cannot be found by its name: a plugin of one file, or a test."""
    if module in sys.modules or _can_be_found(module):
        return
    spec = spec_from_file_location(module, file)
    if spec is None or spec.loader is None:
        return
    sys.modules[module] = module_from_spec(spec)
    try:
        spec.loader.exec_module(sys.modules[module])
    except Exception:  # is met again, and told, where a component of the module is made
        del sys.modules[module]


def _can_be_found(module: str) -> bool:
    try:
        return find_spec(module) is not None
    except (ImportError, ValueError):
        return False


def _unpacked(name: str, data: bytes) -> Any:
    try:
        return pickle.loads(data)
    except Exception as error:  # as above: a stranger's module
        reason = f"{type(error).__name__}: {error}"
        raise NotPortable(f"the section {name!r} cannot be imported by another process ({reason})") from error
