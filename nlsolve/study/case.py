"""One document -> one validated case: its sections, their defaults, and the checks that compare sections."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

from pydantic import BaseModel, ConfigDict, ValidationError, create_model
from pydantic_core import PydanticSerializationError, to_jsonable_python

from nlsolve.contracts.component import Component
from nlsolve.contracts.linear_solver import LinearSolver
from nlsolve.contracts.nonlinear_solver import NonlinearSolver
from nlsolve.contracts.recording import IterateRecording
from nlsolve.contracts.rules.operator import IterationOperator
from nlsolve.contracts.rules.refresh import RefreshRule
from nlsolve.contracts.scene import Misfit, Scene, Section
from nlsolve.registry.classes import CONTRACTS
from nlsolve.registry.component_tables import ComponentTable, class_name
from nlsolve.registry.problems import ABSENT, Problem, problems_in, unknown
from nlsolve.registry.registry import Registry
from nlsolve.registry.rows import PluginRow, meaning_of, parameters_of
from nlsolve.results.parameters import names_settings
from nlsolve.solving.stopping import Budget, StoppingTest
from nlsolve.study.known_parts import KnownPart, KnownParts, keys_of
from nlsolve.study.limits import Limits
from nlsolve.study.sweeps import Document, Point

COMMON: Mapping[str, Section] = {
    "linear": Section(LinearSolver),
    "solver": Section(NonlinearSolver),
    "refresh": Section(RefreshRule, of="solver"),
    "operator": Section(IterationOperator),
    "stop": Section(StoppingTest),
    "budget": Section(Budget),
    "record": Section(IterateRecording),
    "limits": Section(Limits),
}
"""The sections of every case, besides `scene` and those that the scene's class declares."""

METHOD = ("solver", "refresh", "operator", "predictor", "stop", "budget", "record", "limits")
"""Sections that say how a problem is solved, and do not change what a unit of work costs."""

DIGEST_LETTERS = 12

LARGEST = 2**63 - 1
"""Largest integer that the columns of results can hold."""


@dataclass(frozen=True)
class Case:
    """One case to be run.

    id : digest of the validated components; the limits belong to it where a sweep sets them.
    parts : the validated component of each section, under its name.
    known : the same with all that is known of each; cases share it.
    parameters : every parameter under its dotted name ("solver.order"); lists as JSON text. Where a sweep has named
        settings, the names of this case's settings come first, under `variant` or the sweep's own `name`.
    swept : names of the parameters that the study sweeps and that differ between its cases; `variant` stands for every
        parameter that a named setting assigns.
    reference : id of the reference case, with whose velocities this case's are compared; empty: there is none.
    way : section -> its component, of those on which the way to the first state depends; empty: there is none.
    way_id : digest of these components.
    """

    id: str
    parts: Any
    known: Mapping[str, KnownPart]
    parameters: Mapping[str, Any]
    swept: tuple[str, ...]
    reference: str = ""
    way: Mapping[str, Any] = field(default_factory=dict)
    way_id: str = ""

    @property
    def label(self) -> str:
        """The swept parameters with their values, as text for people: "solver.order = 20"."""
        words = [f"{'' if names_settings(name) else f'{name} = '}{self.parameters[name]}" for name in self.swept]
        return ", ".join(words) or "the only case"

    @cached_property
    def problem(self) -> str:
        """A digest of what the case solves, and with which linear solver: the same for cases that differ in method
        only."""
        told = (name for name, part in self.known.items() if name not in METHOD and part.component is not None)
        return _digest(self.known, told)


class Invalid(Exception):
    """Raised for a document that does not make a case; `problems` has an entry for each mistake."""

    def __init__(self, problems: list[Problem]) -> None:
        super().__init__()
        self.problems = problems


class Composer:
    """Makes cases of the installed components and of those that `documents` hold as instances."""

    def __init__(self, registry: Registry, *documents: Mapping[str, Any]) -> None:
        self.registry = registry
        self._known = KnownParts()
        self._models: dict[type[Component], type[BaseModel]] = {}
        self.all_sections: dict[str, Section] = {}
        given = list(classes_in(documents))
        self._holds_instances = bool(given)
        for scene in (*registry.classes(Scene.noun).values(), *given):
            if issubclass(scene, Scene):
                self._add_sections(sections_of(scene))
        self._add_sections(COMMON)

    @property
    def sections(self) -> tuple[str, ...]:
        """Names of the sections that cases of any known scene may have; only their parameters can be swept."""
        return (Scene.noun, *self.all_sections)

    def _add_sections(self, sections: Mapping[str, Section]) -> None:
        """Take up sections; of two with one name that whose component has all keys of the other, or else the last."""
        for name, section in sections.items():
            known = self.all_sections.setdefault(name, section)
            if known.contract is section.contract or not issubclass(known.contract, section.contract):
                self.all_sections[name] = section

    def case(self, document: Document, points: Sequence[Point]) -> Case:
        """The case of a document to which the values of `points`, one of each sweep, are assigned. Raises Invalid."""
        known, model = self.parts(document)
        parts: Any = model.model_construct(**{name: part.component for name, part in known.items()})
        if unclaimed := claims_missing(parts.solver, parts.stop):
            raise Invalid(unclaimed)
        try:
            parts.scene.check(parts)
        except Misfit as misfit:
            value = getattr(getattr(parts, misfit.section), misfit.field)
            raise Invalid([Problem((misfit.section, misfit.field), _plain(value), misfit.expected)]) from misfit
        swept = {name.split(".")[0] for point in points for name in point.values}
        telling = [name for name in known if name != Limits.noun or name in swept]
        way = {name: getattr(parts, name) for name in parts.scene.way(parts)}
        way_id = _digest(known, way) if way else ""
        return Case(_digest(known, telling), parts, known, *_parameters(known, points), way=way, way_id=way_id)

    def parts(self, document: Document) -> tuple[Mapping[str, KnownPart], type[BaseModel]]:
        """The validated part of each section, and the model of them all; a section that is left out gets its default.

        Raises Invalid.
        """
        scene = self.named(document, Scene.noun, Scene)
        if issubclass(scene, Scene):
            sections = sections_of(scene)
        elif scene is Component:  # nobody knows what it needs: the mistakes in all there might be are told
            sections = self.all_sections
        else:  # an instance of another contract
            sections = {}
            document = {Scene.noun: document[Scene.noun]}
        needless = [name for name in document if name not in (Scene.noun, *sections)]
        if needless:
            raise Invalid(
                [
                    Problem((name,), ABSENT, f"the scene {scene.kind_name()!r} has no such section: leave it out")
                    if name in self.all_sections
                    else unknown((name,), ABSENT, "no such section", self.sections)
                    for name in needless
                ]
            )
        for name, section in sections.items():
            default = section.default_table
            if section.of:
                default = getattr(
                    self.named(document, section.of, sections[section.of].contract), f"default_{name}", None
                )
            if default is not None:
                _complete(document, name, default)
            elif not (_has_kinds(section) or any(f.is_required() for f in section.contract.model_fields.values())):
                document.setdefault(name, {})
        model = self.model(scene, sections)
        keys = None if self._holds_instances else keys_of(document, model.model_fields)
        found = None if keys is None else self._known.get(scene, keys)
        if found is not None:
            return found, model
        try:
            validated = model.model_validate(document)
        except ValidationError as error:
            problems = problems_in(error, model, document)
            if scene is Component:  # which other sections are needed is not known
                problems = [problem for problem in problems if problem.place[0] in (Scene.noun, *document)]
            raise Invalid(problems) from error
        plain = self.plain(validated)
        found = {name: KnownPart.of(name, getattr(validated, name), plain[name]) for name in model.model_fields}
        if huge := [
            Problem(tuple(name.split(".")), value, f"should be an integer of at most {LARGEST} in magnitude")
            for part in found.values()
            for name, value in part.parameters.items()
            if isinstance(value, int) and abs(value) > LARGEST
        ]:
            raise Invalid(huge)
        return (found if keys is None else self._known.shared(scene, keys, found)), model

    def model(self, scene: type[Component], sections: Mapping[str, Section]) -> type[BaseModel]:
        """The pydantic model of the sections of one class of scenes."""
        if scene not in self._models:
            fields: dict[str, Any] = {Scene.noun: (self.registry.union(Scene.noun), ...)}
            for name, section in sections.items():
                if _has_kinds(section):
                    fields[name] = (self.registry.union(section.contract.noun), None if section.of else ...)
                else:
                    fields[name] = (section.contract, ...)
            config = ConfigDict(extra="forbid", frozen=True)
            self._models[scene] = create_model("Parts", __config__=config, **fields)
        return self._models[scene]

    def plain(self, parts: BaseModel) -> dict[str, Any]:
        """The sections as JSON values. A component whose class is not the one that its kind alone means has its
        qualified kind, or, when nobody offers the class, an entry `class`: cases of different classes get different
        digests.

        Raises Invalid for a field that cannot be written as JSON.
        """
        try:
            plain = json.loads(parts.model_dump_json())
        except PydanticSerializationError as error:
            sentence = f"a field cannot be written as JSON, by which cases are told apart: {error}"
            raise Invalid([Problem((name,), ABSENT, sentence) for name in unwritable(parts)]) from error
        for name in plain:
            self._tell_class(plain[name], getattr(parts, name))
        return plain

    def _tell_class(self, plain: Any, value: object) -> None:
        if not isinstance(value, Component):
            return
        for name in type(value).model_fields:
            self._tell_class(plain.get(name), getattr(value, name))
        if value.noun not in CONTRACTS:
            return
        kind = self.registry.kind_of(value)
        plain |= {"class": class_name(type(value))} if kind is None else {"kind": kind}

    def named(self, document: Document, section: str, contract: type[Component]) -> type[Component]:
        """The class of the component that a section names by kind or holds as an instance, or Component."""
        return self.registry.class_of(contract.noun, document.get(section)) or Component


def classes_in(document: Any) -> Iterator[type[Component]]:
    """The classes of all components that a document holds as instances, at any depth."""
    if isinstance(document, ComponentTable):
        yield document.cls
    if isinstance(document, Component):
        yield type(document)
    elif isinstance(document, Mapping):
        for value in document.values():
            yield from classes_in(value)
    elif isinstance(document, list | tuple):
        for value in document:
            yield from classes_in(value)


def sections_of(scene: type[Scene]) -> dict[str, Section]:
    """The sections of a class of scenes, by name: those it declares, and those of `COMMON` that it does not replace."""
    return {**scene.sections, **{name: scene.sections.get(name, section) for name, section in COMMON.items()}}


def section_rows(registry: Registry) -> list[PluginRow]:
    """A row for each section that has no kinds, with its fields and the scenes that ask for it."""
    scenes = registry.classes(Scene.noun)
    askers: dict[str, list[str]] = {}
    for kind, scene in scenes.items():
        for name in sections_of(scene) if issubclass(scene, Scene) else ():
            askers.setdefault(name, []).append(kind)
    found = Composer(registry).all_sections
    return [
        PluginRow(
            name,
            "",
            f"nlsolve, for {'every scene' if len(askers[name]) == len(scenes) else ', '.join(askers[name])}",
            parameters_of(section.contract),
            meaning=meaning_of(section.contract),
        )
        for name, section in found.items()
        if name in askers and section.contract not in CONTRACTS.values()
    ]


def _digest(known: Mapping[str, KnownPart], names: Iterable[str]) -> str:
    """The digest of the components of these sections."""
    canonical = ",".join(f'"{name}":{known[name].text}' for name in sorted(names))
    return hashlib.sha256(f"{{{canonical}}}".encode()).hexdigest()[:DIGEST_LETTERS]


def _has_kinds(section: Section) -> bool:
    return CONTRACTS.get(section.contract.noun) is section.contract


def _plain(value: Any) -> Any:
    return list(value) if isinstance(value, tuple) else value


def _complete(document: Document, section: str, default: Mapping[str, Any]) -> None:
    """Fill in the default of a section that names no kind; values given in the section are kept."""
    given = document.get(section, {})
    if isinstance(given, dict) and "kind" not in given and not isinstance(given, ComponentTable):
        document[section] = {**default, **given}


def claims_missing(solver: NonlinearSolver, stop: StoppingTest) -> list[Problem]:
    """One problem if the stopping test waits for a claim that the method never makes; else an empty list."""
    if stop.kind != "claim" or solver.claims:
        return []
    sentence = f"the solver {solver.kind_name()!r} never claims a solution; use residual or difference"
    return [Problem(("stop", "kind"), "claim", sentence)]


def unwritable(composition: BaseModel) -> list[str]:
    """Names of the sections that cannot be written as JSON."""
    found = []
    for name in type(composition).model_fields:
        try:
            to_jsonable_python(getattr(composition, name))
        except PydanticSerializationError:
            found.append(name)
    return found


def _parameters(known: Mapping[str, KnownPart], points: Sequence[Point]) -> tuple[dict[str, Any], tuple[str, ...]]:
    """The names of a case's settings and all its parameters, under dotted names; and the names of the swept ones."""
    assigned = {name for point in points if not point.name for name in point.values}
    below = tuple(f"{name}." for name in assigned)
    parameters: dict[str, Any] = {}
    swept: list[str] = []
    for section, part in known.items():
        parameters |= part.parameters
        if any(name.partition(".")[0] == section for name in assigned):
            swept += [name for name in part.parameters if name in assigned or name.startswith(below)]
    settings: dict[str, str] = {}
    for point in points:
        if point.name:
            settings[point.column] = ", ".join(filter(None, (settings.get(point.column), point.name)))
    return {**settings, **parameters}, (*settings, *swept)
