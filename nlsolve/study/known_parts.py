"""Components that a study has validated already: a section is validated, and written as JSON, once a distinct table."""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from typing import Any

from pydantic import BaseModel

from nlsolve.contracts.component import NAMES_A_FILE, Component
from nlsolve.study.sweeps import Document, leaves

Key = tuple[type, str, str]
"""The class of the scene, the name of a section, and its table as JSON."""


@dataclass(frozen=True)
class KnownPart:
    """The component of one section.

    component : None where the section has none.
    text : its fields as JSON, keys in order, but for incidental ones.
    parameters : its fields under dotted names, lists as JSON text.
    classes, files : the class and the files of each component at any depth.
    """

    component: Any
    text: str
    parameters: Mapping[str, Any]
    classes: frozenset[type]
    files: tuple[str, ...]

    @classmethod
    def of(cls, name: str, component: Any, plain: Any) -> KnownPart:
        """The part of a section called `name`."""
        flat = {} if plain is None else {name: plain}
        parameters = {
            dotted: json.dumps(value) if isinstance(value, list | dict) else value for dotted, value in leaves(flat)
        }
        text = json.dumps(_telling(component, plain), sort_keys=True, separators=(",", ":"))
        return cls(component, text, parameters, classes_of(component), files_read(component))


@dataclass
class KnownParts:
    """The parts of all cases so far, by scene, section and table."""

    parts: dict[Key, KnownPart] = field(default_factory=dict)

    def get(self, scene: type, keys: Mapping[str, str]) -> dict[str, KnownPart] | None:
        """The parts of one case by section; None when one of them is not known yet."""
        found = {}
        for name, text in keys.items():
            part = self.parts.get((scene, name, text))
            if part is None:
                return None
            found[name] = part
        return found

    def shared(self, scene: type, keys: Mapping[str, str], parts: Mapping[str, KnownPart]) -> dict[str, KnownPart]:
        """The parts of one case, those of earlier cases where they have the same tables; all are remembered."""
        return {name: self.parts.setdefault((scene, name, text), parts[name]) for name, text in keys.items()}


def keys_of(document: Document, names: Iterable[str]) -> dict[str, str] | None:
    """The table of each section as JSON; None when a table holds what JSON cannot tell apart from another value."""
    try:
        return {name: _written(document.get(name)) for name in names}
    except (TypeError, ValueError):
        return None


_written = json.JSONEncoder(sort_keys=True).encode


def _telling(component: Any, plain: Any) -> Any:
    """The fields of a component, as JSON values, that tell cases apart: all but incidental ones, at any depth."""
    if not (isinstance(component, Component) and isinstance(plain, dict)):
        return plain
    kept = {name: value for name, value in plain.items() if name not in component.incidental}
    return {name: _telling(getattr(component, name, None), value) for name, value in kept.items()}


def classes_of(value: Any) -> frozenset[type]:
    """The class of every component in a value, at any depth."""
    return frozenset(map(type, _inside(value)))


def files_read(value: Any) -> tuple[str, ...]:
    """The files whose contents a value depends on: fields of type `InputFile`, and those that hold a Path, in every
    component in it."""
    found = [
        str(Path(given))
        for model in _inside(value)
        for name, is_named in _fields(type(model))
        if isinstance(given := getattr(model, name), Path) or (is_named and isinstance(given, str))
    ]
    return tuple(dict.fromkeys(found))


def _inside(value: Any) -> Iterator[BaseModel]:
    """Every component in a value, at any depth."""
    if isinstance(value, BaseModel):
        yield value
        for name, _ in _fields(type(value)):
            yield from _inside(getattr(value, name))
    elif isinstance(value, Mapping):
        for inner in value.values():
            yield from _inside(inner)
    elif isinstance(value, list | tuple):
        for inner in value:
            yield from _inside(inner)


@cache
def _fields(cls: type[BaseModel]) -> list[tuple[str, bool]]:
    """The fields of a class, and whether each is of type `InputFile`."""
    return [(name, NAMES_A_FILE in field.metadata) for name, field in cls.model_fields.items()]
