"""One document -> one validated case: its sections, what they are when left out, and what they must agree on."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from pydantic import BaseModel, ConfigDict, ValidationError, create_model
from pydantic_core import PydanticSerializationError, to_jsonable_python

from nlsolve.contracts.component import Component
from nlsolve.contracts.linear_solver import LinearSolver
from nlsolve.contracts.nonlinear_solver import NonlinearSolver
from nlsolve.contracts.rules.refresh import RefreshRule
from nlsolve.contracts.scene import Misfit, Scene, Section
from nlsolve.registry.component_tables import ComponentTable, class_name
from nlsolve.registry.problems import ABSENT, Problem, problems_in, unknown
from nlsolve.registry.registry import CONTRACTS, Registry
from nlsolve.results.parameters import names_settings
from nlsolve.solving.stopping import Budget, StoppingTest
from nlsolve.study.sweeps import Document, Point, leaves

COMMON: Mapping[str, Section] = {
    "linear": Section(LinearSolver),
    "solver": Section(NonlinearSolver),
    "refresh": Section(RefreshRule, of="solver"),
    "stop": Section(StoppingTest),
    "budget": Section(Budget),
}
"""The sections of every case, beside `scene` and those that the scene's class declares."""

DIGEST_LETTERS = 12


@dataclass(frozen=True)
class Case:
    """One case to be run.

    id : digest of the validated components.
    parts : the validated component of each section, under its name.
    parameters : every parameter under its dotted name ("solver.order"); lists as JSON text. Before them, where a sweep
        has named settings, `variant` or what the sweep calls them: the names of this case's.
    swept : the names among them that the study sweeps and that differ between its cases; `variant` stands for all that
        its settings assign.
    reference : id of the case whose velocities are held to be right; empty without one.
    """

    id: str
    parts: Any
    parameters: Mapping[str, Any]
    swept: tuple[str, ...]
    reference: str = ""

    @property
    def label(self) -> str:
        """The swept parameters, for people."""
        words = [f"{'' if names_settings(name) else f'{name} = '}{self.parameters[name]}" for name in self.swept]
        return ", ".join(words) or "the only case"


class Invalid(Exception):
    """What is wrong with a document that does not make a case."""

    def __init__(self, problems: list[Problem]) -> None:
        super().__init__()
        self.problems = problems


class Composer:
    """Makes cases of what is installed, and of the scenes that a document brings as instances."""

    def __init__(self, registry: Registry, document: Document) -> None:
        self.registry = registry
        self._models: dict[type[Component], type[BaseModel]] = {}
        self._all: dict[str, Section] = {}
        for scene in (*registry.classes(Scene.noun).values(), *classes_in(document)):
            if issubclass(scene, Scene):
                self._all |= sections_of(scene)
        self._all |= COMMON

    @property
    def sections(self) -> tuple[str, ...]:
        """The parts of a study that cases are made of, and that can be swept: of all scenes there are."""
        return (Scene.noun, *self._all)

    def case(self, document: Document, points: Sequence[Point]) -> Case:
        """The case of a document that the points of its sweeps have been assigned to. Raises Invalid."""
        parts: Any = self.parts(document)
        if unclaimed := claims_missing(parts.solver, parts.stop):
            raise Invalid(unclaimed)
        try:
            parts.scene.check(parts)
        except Misfit as misfit:
            value = getattr(getattr(parts, misfit.section), misfit.field)
            raise Invalid([Problem((misfit.section, misfit.field), _plain(value), misfit.expected)]) from misfit
        plain = self.plain(parts)
        canonical = json.dumps(plain, sort_keys=True, separators=(",", ":"))
        digest = hashlib.sha256(canonical.encode()).hexdigest()[:DIGEST_LETTERS]
        chosen = {name: section for name, section in plain.items() if section is not None}  # None: left out on purpose
        return Case(digest, parts, *_parameters(chosen, points))

    def parts(self, document: Document) -> BaseModel:
        """The validated components of all sections, those left out at their defaults."""
        scene = self.named(document, Scene.noun, Scene)
        if issubclass(scene, Scene):
            sections = sections_of(scene)
        elif scene is Component:  # nobody knows what it needs: the mistakes in all there might be are told
            sections = self._all
        else:  # an instance of another contract
            sections = {}
            document = {Scene.noun: document[Scene.noun]}
        needless = [name for name in document if name not in (Scene.noun, *sections)]
        if needless:
            raise Invalid(
                [
                    Problem((name,), ABSENT, f"the scene {scene.kind_name()!r} has no such section: leave it out")
                    if name in self._all
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
        model = self.model(scene, sections)
        try:
            return model.model_validate(document)
        except ValidationError as error:
            raise Invalid(problems_in(error, model, document)) from error

    def model(self, scene: type[Component], sections: Mapping[str, Section]) -> type[BaseModel]:
        """The pydantic model of the sections of one class of scenes."""
        if scene not in self._models:
            fields: dict[str, Any] = {Scene.noun: (self.registry.union(Scene.noun), ...)}
            for name, section in sections.items():
                if CONTRACTS.get(section.contract.noun) is section.contract:
                    fields[name] = (self.registry.union(section.contract.noun), None if section.of else ...)
                elif any(field.is_required() for field in section.contract.model_fields.values()):
                    fields[name] = (section.contract, ...)
                else:
                    fields[name] = (section.contract, section.contract())
            config = ConfigDict(extra="forbid", frozen=True)
            self._models[scene] = create_model("Parts", __config__=config, **fields)
        return self._models[scene]

    def plain(self, parts: BaseModel) -> dict[str, Any]:
        """The sections as JSON has them. A component that is not of the installed class of its kind has its `class`
        beside it, so that cases of two classes differ.
        """
        try:
            plain = json.loads(parts.model_dump_json())
        except PydanticSerializationError as error:
            sentence = f"a field cannot be written as JSON, by which cases are told apart: {error}"
            raise Invalid([Problem((name,), ABSENT, sentence) for name in unwritable(parts)]) from error
        for name in plain:
            self._add_class(plain[name], getattr(parts, name))
        return plain

    def _add_class(self, plain: Any, value: object) -> None:
        if not isinstance(value, Component):
            return
        for name in type(value).model_fields:
            self._add_class(plain.get(name), getattr(value, name))
        if value.noun in CONTRACTS and not self.registry.is_installed(value):
            plain["class"] = class_name(type(value))

    def named(self, document: Document, section: str, contract: type[Component]) -> type[Component]:
        """The class that a section names, or is of; Component itself where there is none."""
        return self.registry.class_of(contract.noun, document.get(section)) or Component


def classes_in(document: Any) -> Iterator[type[Component]]:
    """The classes of all components that stand somewhere in a document as instances."""
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
    """The sections that a class of scenes declares, and those of every case that it does not declare otherwise."""
    return {**scene.sections, **{name: scene.sections.get(name, section) for name, section in COMMON.items()}}


def _plain(value: Any) -> Any:
    return list(value) if isinstance(value, tuple) else value


def _complete(document: Document, section: str, default: Mapping[str, Any]) -> None:
    """Give a section that names no kind its default."""
    given = document.get(section, {})
    if isinstance(given, dict) and "kind" not in given and not isinstance(given, ComponentTable):
        document[section] = {**default, **given}


def claims_missing(solver: NonlinearSolver, stop: StoppingTest) -> list[Problem]:
    """The problem of a stopping test that waits for a claim which the method never makes; none otherwise."""
    if stop.kind != "claim" or solver.claims:
        return []
    sentence = f"the solver {solver.kind_name()!r} never claims a solution; use residual or difference"
    return [Problem(("stop", "kind"), "claim", sentence)]


def unwritable(composition: BaseModel) -> list[str]:
    """The sections that JSON cannot hold."""
    found = []
    for name in type(composition).model_fields:
        try:
            to_jsonable_python(getattr(composition, name))
        except PydanticSerializationError:
            found.append(name)
    return found


def _parameters(plain: Mapping[str, Any], points: Sequence[Point]) -> tuple[dict[str, Any], tuple[str, ...]]:
    """Every parameter of a composition, before them the names of its settings; and which of them are swept."""
    parameters = {name: json.dumps(value) if isinstance(value, list | dict) else value for name, value in leaves(plain)}
    assigned = [name for point in points if not point.name for name in point.values]
    swept = [
        parameter
        for parameter in parameters
        if any(parameter == name or parameter.startswith(f"{name}.") for name in assigned)
    ]
    settings: dict[str, str] = {}
    for point in points:
        if point.name:
            settings[point.column] = ", ".join(filter(None, (settings.get(point.column), point.name)))
    return {**settings, **parameters}, (*settings, *swept)
