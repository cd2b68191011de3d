"""Sweeps and overrides, and how their values are assigned to a study's document."""

from __future__ import annotations

import itertools
import tomllib
from collections.abc import Iterator, Mapping
from copy import deepcopy
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

from pydantic import BaseModel, ConfigDict, Field, model_validator

from nlsolve.contracts.component import Component
from nlsolve.registry.component_tables import ComponentTable, table_of
from nlsolve.registry.problems import Problem, StudyError
from nlsolve.registry.toml_lines import Place
from nlsolve.results.aggregates import COUNT, WITHIN
from nlsolve.results.parameters import VARIANT, names_settings
from nlsolve.results.selection import Names
from nlsolve.results.verdicts import OUTCOME, SOLVED, SPEEDUP
from nlsolve.study.generators import Values, is_generator

Document = dict[str, Any]

GRIDS = ("grid", "zip")
"""Entries of a sweep that have a table of parameters with their values."""


@dataclass(frozen=True)
class Point:
    """The values, by dotted name, that one point of a sweep assigns.

    name, column : of a named setting, its name and the column of `runs` that holds it.
    place, places : where the setting, and each of its values, is written in the document.
    """

    values: dict[str, Any]
    name: str = ""
    column: str = VARIANT
    place: Place = ()
    places: Mapping[str, Place] = field(default_factory=dict)

    @cached_property
    def label(self) -> str:
        """The point as text for people."""
        return self.name or ", ".join(f"{name} = {value}" for name, value in self.values.items())


class Setting(BaseModel):
    """A named table of assignments; an empty one leaves the study unchanged."""

    model_config = ConfigDict(frozen=True, extra="allow")

    name: str = Field(min_length=1, description="what the setting is called in `variant`")

    def point(self, place: Place = (), column: str = VARIANT) -> Point:
        """The setting as a point of its sweep; `place` is where it is written."""
        table = self.model_extra or {}
        places = {name: (*place, *inside) for name, inside in places_of(table, whole_kinds=True).items()}
        return Point(dict(leaves(table, whole_kinds=True)), self.name, column, place, places)


class Repeat(BaseModel):
    """Seeds first, first + 1, …, one a repetition; several seeds go side by side."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    times: int = Field(gt=0, description="number of repetitions")
    seeds: Names = Field(min_length=1, description='parameter or parameters that are seeds: "start.seed"')
    first: int = Field(0, description="the first seed")

    @property
    def columns(self) -> dict[str, list[int]]:
        """The seeds under the dotted name of each parameter."""
        return {name: list(range(self.first, self.first + self.times)) for name in self.seeds}


class Sweep(BaseModel):
    """Values for parameters: every combination (`grid`), side by side (`zip`), named settings one by one (`each`), or
    the same with other seeds (`repeat`).

    grid = { law.index = [1.0, 0.5], physics.penalty = [0.0, 1e2] }                        four points
    grid = { "law.index" = { linspace = [0.1, 1.0, 10] } }                                 ten points
    zip = { law.index = [1.0, 0.5], physics.penalty = [0.0, 1e2] }                         two points
    each = [ { name = "p = 40", solver = { kind = "anm", order = 40 } },
             { name = "ε₀ = 10", "law.regularization" = 10.0 }, { name = "as it is" } ]  three points
    repeat = { times = 20, seeds = "start.seed" }                                         twenty points

    A table with a `kind` replaces its whole section. The names of settings are written to a column of `runs`: to
    `variant`, or to the one that the sweep's `name` gives; names from several sweeps in one column are joined by
    commas. They do not enter a case's id.
    """

    model_config = ConfigDict(frozen=True, extra="forbid")

    grid: dict[str, Values] | None = Field(None, description="parameter -> values; all combinations")
    zip: dict[str, Values] | None = Field(None, description="parameter -> values; the first of each, the second, …")
    each: tuple[Setting, ...] | None = Field(None, description="named tables of assignments; one after the other")
    repeat: Repeat | None = Field(None, description="the same with other seeds")
    name: str = Field(
        VARIANT, pattern=r"^[A-Za-z][A-Za-z0-9_-]*$", description="column of `runs` for the names of each"
    )

    @model_validator(mode="before")
    @classmethod
    def _flatten(cls, data: Any) -> Any:
        """{ solver.order = […] } and { "solver.order" = […] } mean the same."""
        if not isinstance(data, dict):
            return data
        return {
            mode: dict(leaves(table, generators=True)) if isinstance(table, dict) and mode in GRIDS else table
            for mode, table in data.items()
        }

    @model_validator(mode="after")
    def _values(self) -> Sweep:
        if sum(mode is not None for mode in (self.grid, self.zip, self.each, self.repeat)) != 1:
            raise ValueError("a sweep has one of grid, zip, each and repeat")
        if not names_settings(self.name) or self.name in (OUTCOME, SOLVED, SPEEDUP, WITHIN, COUNT):
            raise ValueError(f"name = {self.name!r} is a column of the results already; choose another")
        if self.each is None and self.name != VARIANT:
            raise ValueError(f"name = {self.name!r} is for the names of each, and there are none; drop it")
        empty = [name for name, values in self.columns.items() if not values]
        if empty or not (self.columns or self.each):
            raise ValueError(f"{empty[0]!r} has no values" if empty else "nothing is swept")
        if self.zip is not None and len({len(values) for values in self.zip.values()}) > 1:
            lengths = ", ".join(f"{name!r} has {len(values)}" for name, values in self.zip.items())
            raise ValueError(f"zip needs lists of one length; {lengths}")
        names = [setting.name for setting in self.each or ()]
        twice = [name for name in names if names.count(name) > 1]
        if twice:
            raise ValueError(f"{names.count(twice[0])} settings are called {twice[0]!r}; give each its own name")
        return self

    @property
    def columns(self) -> dict[str, list[Any]]:
        """The swept values of each parameter, under its dotted name."""
        if self.repeat is not None:
            return dict(self.repeat.columns)
        if self.each is None:
            return self.grid or self.zip or {}
        found: dict[str, list[Any]] = {}
        for setting in self.each:
            for name, value in setting.point().values.items():
                found.setdefault(name, []).append(value)
        return found

    def points(self, place: Place = ()) -> list[Point]:
        """The points of the sweep, in order; `place` is where the sweep is written."""
        if self.each is not None:
            return [setting.point((*place, "each", number), self.name) for number, setting in enumerate(self.each)]
        rows = (
            zip(*self.columns.values(), strict=True) if self.grid is None else itertools.product(*self.columns.values())
        )
        return [Point(dict(zip(self.columns, row, strict=True))) for row in rows]


def assign_all(document: Document, values: Mapping[str, Any]) -> list[Problem]:
    """Set values in a document by dotted name; a problem for each name that leads through a value that is no table.

    A word inside a section is short for a table with that kind: over range = "ratio", solver.range.most = 2.0 sets
    range = { kind = "ratio", most = 2.0 }.
    """
    problems = []
    for name, value in values.items():
        *parents, last = name.split(".")
        table = document
        for depth, part in enumerate(parents):
            if depth and isinstance(table.get(part), str):
                table[part] = {"kind": table[part]}
            table = table.setdefault(part, {})
            if not isinstance(table, dict):
                above = ".".join(parents[: depth + 1])
                problems.append(Problem((name,), value, f"{above!r} is not a table"))
                break
        else:
            table[last] = merged(table.get(last), value)
    return problems


def merged(old: Any, new: Any) -> Any:
    """`new` merged over `old`: a component, or a table with a `kind`, replaces `old`; other tables are merged into it.

    A component becomes a table that remembers its class, so that its fields can be set one by one. A table without a
    kind is merged into a word as into the table with that kind.
    """
    if isinstance(new, Component):
        new = table_of(new)
    if isinstance(new, Mapping):
        whole = isinstance(new, ComponentTable) or "kind" in new
        under = {} if whole else {"kind": old} if isinstance(old, str) else old if isinstance(old, dict) else {}
        table = {**under, **{name: merged(under.get(name), value) for name, value in new.items()}}
        origin = new if whole else under
        return ComponentTable(origin.cls, table) if isinstance(origin, ComponentTable) else table
    return new if isinstance(new, str | int | float) else deepcopy(new)  # deepcopy is slow, and most are such


def leaves(
    table: Mapping[str, Any], above: str = "", whole_kinds: bool = False, generators: bool = False
) -> Iterator[tuple[str, Any]]:
    """Dotted name and value of every entry that is no table.

    whole_kinds, generators : whether a table with a `kind`, and one that generates values, is a value.
    """
    for name, value in table.items():
        dotted = f"{above}{name}"
        whole = isinstance(value, Mapping) and (
            not value or (whole_kinds and "kind" in value) or (generators and is_generator(dotted, value))
        )
        if isinstance(value, Mapping) and not whole:
            yield from leaves(value, f"{dotted}.", whole_kinds, generators)
        else:
            yield dotted, value


def swept_places(document: Document) -> dict[str, Place]:
    """Where a document has the values of each swept parameter. The document need not be valid."""
    sweeps = document.get("sweep")
    return {
        name: ("sweep", number, mode, *place)
        for number, sweep in enumerate(sweeps if isinstance(sweeps, list) else [])
        for mode, written in (sweep.items() if isinstance(sweep, dict) else ())
        for name, place in _places_in_sweep(mode, written).items()
    }


def _places_in_sweep(mode: str, written: Any) -> dict[str, Place]:
    """Where one entry of a sweep has the values of each parameter."""
    if mode == "repeat":
        seeds = written.get("seeds", []) if isinstance(written, dict) else []
        return {name: ("seeds",) for name in ([seeds] if isinstance(seeds, str) else seeds) if isinstance(name, str)}
    return {
        name: (*inside, *place)
        for inside, table in _tables_in(written)
        for name, place in places_of(table, whole_kinds=mode == "each", generators=mode in GRIDS).items()
        if name != "name"
    }


def _tables_in(written: Any) -> list[tuple[Place, Mapping[str, Any]]]:
    """`written` itself if it is a table, or its tables if it is a list, each with its place in `written`."""
    found = enumerate(written) if isinstance(written, list) else [((), written)]
    return [((place,) if isinstance(place, int) else (), table) for place, table in found if isinstance(table, dict)]


def places_of(table: Mapping[str, Any], whole_kinds: bool = False, generators: bool = False) -> dict[str, Place]:
    """Dotted names in a table, and the keys they are written with: "a.b" is either a."b" or a.b."""
    names = [name for name, _ in leaves(table, whole_kinds=whole_kinds, generators=generators)]
    return {name: (name,) if name in table else tuple(name.split(".")) for name in names}


def parse_assignments(texts: list[str]) -> dict[str, Any]:
    """Values by name from the `key=value` of --set; a value that is not TOML is a string.

    Raises StudyError for a text that is not key=value.
    """
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
