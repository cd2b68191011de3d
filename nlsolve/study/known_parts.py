"""Components that a study has validated already: a section is validated, and written as JSON, once a distinct table."""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import Any

from nlsolve.study.sweeps import Document, leaves

Key = tuple[type, str, str]
"""The class of the scene, the name of a section, and its table as JSON."""


@dataclass(frozen=True)
class KnownPart:
    """The component of one section.

    component : None where the section has none.
    text : its fields as JSON, keys in order.
    parameters : its fields under dotted names, lists as JSON text.
    """

    component: Any
    text: str
    parameters: Mapping[str, Any]

    @classmethod
    def of(cls, name: str, component: Any, plain: Any) -> KnownPart:
        """The part of a section called `name`."""
        flat = {} if plain is None else {name: plain}
        parameters = {
            dotted: json.dumps(value) if isinstance(value, list | dict) else value for dotted, value in leaves(flat)
        }
        return cls(component, json.dumps(plain, sort_keys=True, separators=(",", ":")), parameters)


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
        return {name: json.dumps(document.get(name), sort_keys=True) for name in names}
    except (TypeError, ValueError):
        return None
