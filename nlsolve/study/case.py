"""One document -> one validated case: its sections, what they are when left out, and what they must agree on."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields
from typing import Annotated, Any

from pydantic import BaseModel, ConfigDict, Field, ValidationError, create_model
from pydantic_core import PydanticSerializationError, to_jsonable_python

from nlsolve.algebra.simulation import AlgebraicSetup
from nlsolve.contracts.component import Component
from nlsolve.contracts.nonlinear_solver import NonlinearSolver
from nlsolve.contracts.system import System
from nlsolve.flow.continuation import LOAD, Start
from nlsolve.flow.setup import Setup
from nlsolve.registry.component_tables import ComponentTable, class_name
from nlsolve.registry.problems import ABSENT, Problem, problems_in
from nlsolve.registry.registry import CONTRACTS, Registry
from nlsolve.results.verdicts import names_settings
from nlsolve.solving.stopping import Budget, StoppingTest
from nlsolve.study.sweeps import Document, Point, leaves

SECTIONS = tuple(part.name for part in fields(Setup))
"""The parts of a study that a case is made of, and that can be swept."""

DEFAULT_KINDS = {"linear": {"kind": "superlu"}, "starter": {"kind": "newton"}, "predictor": {"kind": "previous"}}
"""Sections that may be left out, or written without a kind."""

DEFAULTS_OF_KINDS = {"solver": "refresh", "discretizer": "counterpart"}
"""Sections whose default the kind of another one names, as `default_refresh` and `default_counterpart`."""

OF_A_SYSTEM = tuple(part.name for part in fields(AlgebraicSetup))
"""Those of them that a scene without a flow has: F(u) = 0 knows no law, no discretizer, no way to a first state."""

DEFAULT_KINDS_OF_A_SYSTEM = {"linear": {"kind": "superlu"}, "solver": {"kind": "robust"}}
"""The same where the scene is a system of equations: it may be solved without a choice of the method."""

DIGEST_LETTERS = 12


@dataclass(frozen=True)
class Case:
    """One setup to be run.

    id : digest of the validated components.
    parameters : every parameter under its dotted name ("solver.order"); lists as JSON text. Before them, where a sweep
        has named settings, `variant` or what the sweep calls them: the names of this case's.
    swept : the names among them that the study sweeps and that differ between its cases; `variant` stands for all that
        its settings assign.
    reference : id of the case whose velocities are held to be right; empty without one.
    """

    id: str
    setup: Setup | AlgebraicSetup
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
    """Makes cases of what is installed."""

    def __init__(self, registry: Registry) -> None:
        self.registry = registry
        parts: dict[str, Any] = {noun: (registry.union(noun), ...) for noun in CONTRACTS if noun in SECTIONS} | {
            "refresh": (registry.union("refresh"), None),  # absent only when there is no solver to ask for its default
            "starter": (registry.union("solver"), ...),
            "counterpart": (registry.union("discretizer"), None),
            "stop": (StoppingTest, StoppingTest()),
            "start": (Start, Start()),
            "budget": (Budget, Budget()),
            "record": (tuple[Annotated[float, Field(ge=0, allow_inf_nan=False)], ...], ()),
        }
        config = ConfigDict(extra="forbid", frozen=True)
        self.model = create_model("Composition", __config__=config, **parts)
        self.model_of_a_system = create_model(
            "SystemComposition", __config__=config, **{name: parts[name] for name in OF_A_SYSTEM}
        )

    def case(self, document: Document, points: Sequence[Point]) -> Case:
        """The case of a document that the points of its sweeps have been assigned to. Raises Invalid."""
        of_a_system = issubclass(self.named(document, "scene"), System)
        composition = self.composition(document, of_a_system)
        chosen = {name: getattr(composition, name) for name in (OF_A_SYSTEM if of_a_system else SECTIONS)}
        setup = AlgebraicSetup(**chosen) if of_a_system else Setup(**chosen)
        if unclaimed := claims_missing(setup.solver, setup.stop):
            raise Invalid(unclaimed)
        if isinstance(setup, Setup):
            _check_continuation(setup)
        plain = self.plain(composition)
        canonical = json.dumps(plain, sort_keys=True, separators=(",", ":"))
        digest = hashlib.sha256(canonical.encode()).hexdigest()[:DIGEST_LETTERS]
        return Case(digest, setup, *_parameters(plain, points))

    def composition(self, document: Document, of_a_system: bool) -> BaseModel:
        """The validated sections, those left out at their defaults."""
        sections, model = (OF_A_SYSTEM, self.model_of_a_system) if of_a_system else (SECTIONS, self.model)
        needless = [name for name in document if name not in sections]
        if needless:
            sentence = "a scene that is a system of equations has no such section: leave it out"
            raise Invalid([Problem((name,), ABSENT, sentence) for name in needless])
        for section, default in (DEFAULT_KINDS_OF_A_SYSTEM if of_a_system else DEFAULT_KINDS).items():
            _complete(document, section, default)
        for noun, section in DEFAULTS_OF_KINDS.items():
            if section not in sections:
                continue
            of_its_kind = getattr(self.named(document, noun), f"default_{section}", None)
            if of_its_kind is not None:
                _complete(document, section, of_its_kind)
        try:
            return model.model_validate(document)
        except ValidationError as error:
            raise Invalid(problems_in(error, model, document)) from error

    def plain(self, composition: BaseModel) -> dict[str, Any]:
        """The sections as JSON has them. A component that is not of the installed class of its kind has its `class`
        beside it, so that cases of two classes differ.
        """
        try:
            plain = json.loads(composition.model_dump_json())
        except PydanticSerializationError as error:
            sentence = f"a field cannot be written as JSON, by which cases are told apart: {error}"
            raise Invalid([Problem((name,), ABSENT, sentence) for name in unwritable(composition)]) from error
        for name in plain:
            self._add_class(plain[name], getattr(composition, name))
        return plain

    def _add_class(self, plain: Any, value: object) -> None:
        if not isinstance(value, Component):
            return
        for name in type(value).model_fields:
            self._add_class(plain.get(name), getattr(value, name))
        if value.noun in CONTRACTS and not self.registry.is_installed(value):
            plain["class"] = class_name(type(value))

    def named(self, document: Document, section: str) -> type[Component]:
        """The class that a section names, or is of; Component itself where there is none."""
        return self.registry.class_of(section, document.get(section)) or Component


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


def _check_continuation(setup: Setup) -> None:
    """Refuse a way to the first state that the law cannot go."""
    try:
        setup.start.stages(setup.law)
    except ValidationError as error:
        reasons = "; ".join(detail["msg"] for detail in error.errors())
        raise Invalid(
            [Problem(("start", "values"), list(setup.start.values), f"refused by the law: {reasons}")]
        ) from error
    except ValueError as error:
        field = "values" if setup.start.by == LOAD else "by"
        reason = str(error).partition(": ")[2]
        raise Invalid([Problem(("start", field), getattr(setup.start, field), reason)]) from error


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
