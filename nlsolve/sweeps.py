"""What is varied and what is set by hand: sweeps, overrides, and how they change a study's document."""

from __future__ import annotations

import itertools
import tomllib
from collections.abc import Iterator, Mapping
from copy import deepcopy
from typing import Any

from pydantic import BaseModel, ConfigDict, Field, model_validator

from nlsolve.component import Component
from nlsolve.errors import Problem, StudyError
from nlsolve.locate import Place

Document = dict[str, Any]


class Sweep(BaseModel):
    """Values for parameters: every combination (`grid`) or side by side (`zip`)."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    grid: dict[str, list[Any]] | None = Field(None, description="parameter -> values; all combinations")
    zip: dict[str, list[Any]] | None = Field(None, description="parameter -> values; the first of each, the second, …")

    @model_validator(mode="before")
    @classmethod
    def _flatten(cls, data: Any) -> Any:
        """{ solver.order = […] } and { "solver.order" = […] } mean the same."""
        if not isinstance(data, dict):
            return data
        return {mode: dict(leaves(table)) if isinstance(table, dict) else table for mode, table in data.items()}

    @model_validator(mode="after")
    def _values(self) -> Sweep:
        if (self.grid is None) == (self.zip is None):
            raise ValueError("a sweep has either grid or zip")
        empty = [name for name, values in self.columns.items() if not values]
        if empty or not self.columns:
            raise ValueError(f"{empty[0]!r} has no values" if empty else "nothing is swept")
        if self.zip is not None and len({len(values) for values in self.zip.values()}) > 1:
            lengths = ", ".join(f"{name!r} has {len(values)}" for name, values in self.zip.items())
            raise ValueError(f"zip needs lists of one length; {lengths}")
        return self

    @property
    def columns(self) -> dict[str, list[Any]]:
        """Values by parameter."""
        return self.grid or self.zip or {}

    def assignments(self) -> list[dict[str, Any]]:
        """What is set, point by point."""
        points = (
            itertools.product(*self.columns.values()) if self.zip is None else zip(*self.columns.values(), strict=True)
        )
        return [dict(zip(self.columns, point, strict=True)) for point in points]


def assign_all(document: Document, values: Mapping[str, Any]) -> list[Problem]:
    """Set dotted names in a document; a problem for each that leads through something that is not a table."""
    problems = []
    for name, value in values.items():
        *parents, last = name.split(".")
        table = document
        for depth, part in enumerate(parents):
            table = table.setdefault(part, {})
            if not isinstance(table, dict):
                above = ".".join(parents[: depth + 1])
                problems.append(Problem((name,), value, f"{above!r} is not a table"))
                break
        else:
            table[last] = merged(table.get(last), value)
    return problems


def merged(old: Any, new: Any) -> Any:
    """`new` over `old`: a table with a `kind` replaces what was there, one without is merged into it."""
    if isinstance(new, Component):
        return new.model_dump()
    if isinstance(new, Mapping):
        under = old if isinstance(old, dict) and "kind" not in new else {}
        return {**under, **{name: merged(under.get(name), value) for name, value in new.items()}}
    return deepcopy(new)


def leaves(table: Mapping[str, Any], above: str = "") -> Iterator[tuple[str, Any]]:
    """Dotted name and value of everything that is not itself a table."""
    for name, value in table.items():
        if isinstance(value, Mapping) and value:
            yield from leaves(value, f"{above}{name}.")
        else:
            yield f"{above}{name}", value


def swept_places(document: Document) -> dict[str, Place]:
    """Where in a document every swept parameter has its values, whatever else is wrong with the document."""
    sweeps = document.get("sweep")
    return {
        name: ("sweep", number, mode, *place)
        for number, sweep in enumerate(sweeps if isinstance(sweeps, list) else [])
        for mode, table in (sweep.items() if isinstance(sweep, dict) else ())
        for name, place in (places_of(table).items() if isinstance(table, dict) else ())
    }


def places_of(table: Mapping[str, Any]) -> dict[str, Place]:
    """Dotted names in a table, and the keys they are written with: "a.b" is either a."b" or "a.b"."""
    return {name: (name,) if name in table else tuple(name.split(".")) for name, _ in leaves(table)}


def parse_assignments(texts: list[str]) -> dict[str, Any]:
    """`key=value` as given to --set; a value that is not TOML is a string. Raises StudyError."""
    parsed = {}
    for text in texts:
        name, equals, value = text.partition("=")
        if not (equals and name.strip()):
            raise StudyError(f"--set {text}: expected key=value, such as solver.order=20")
        try:
            parsed[name.strip()] = tomllib.loads(f"value = {value}")["value"]
        except tomllib.TOMLDecodeError:
            parsed[name.strip()] = value.strip()
    return parsed
