"""The mistakes in a study as sentences: file, line, dotted place, offending value, and what is expected instead."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from difflib import get_close_matches
from typing import Any, get_args

from pydantic import BaseModel, ValidationError

from nlsolve.contracts.component import Component
from nlsolve.contracts.status import InputError
from nlsolve.registry.classes import CONTRACTS
from nlsolve.registry.component_tables import ComponentTable
from nlsolve.registry.registry import registry_in_use
from nlsolve.registry.toml_lines import Place, nearest_place

LONGEST_VALUE = 60
"""Longest offending value that a sentence repeats, in characters."""

ABSENT = object()
"""Stands for a value that is missing, or that the sentence need not repeat."""

MISSING = "required, and missing"

SHAPES = dict.fromkeys(("tuple_type", "list_type"), "should be a list") | dict.fromkeys(
    ("dict_type", "model_type"), "should be a table"
)
"""What is said of a value that is no list or no table, by pydantic's name of the mistake."""

MOVED: dict[str, str] = {
    "counterpart": "error_estimator",
    "starter": "start.solver",
    "scene.horizon": "time.horizon",
    "scene.increment": "time.increment",
    "scene.density": "physics.density",
    "scene.inertia": "physics.inertia",
    "scene.convection": "physics.convection",
    "scene.penalty": "physics.penalty",
    "scene.penalty_unit": "physics.penalty_unit",
    "scene.divergence": "physics.divergence_tolerance",
    "scene.motion_of_nodes": "motion.nodes",
    "scene.markers": "motion.markers",
    "scene.shifting": "motion.shifting",
    "scene.skin": "motion.skin",
    "scene.probe": "record.probe",
    "budget.pressures": "physics.pressure_iterations",
}
"""Dotted places of sections and fields in older study files, and their present names."""


class StudyError(InputError):
    """A study cannot be run as it is written. The message has one sentence, on its own line, for each mistake."""

    def __init__(self, *problems: str) -> None:
        super().__init__("\n".join(problems))
        self.problems = problems


@dataclass(frozen=True)
class Problem:
    """One mistake in a document: its place, the value there, and what is expected instead."""

    place: Place
    value: Any
    expected: str

    def sentence(self, source: Source) -> str:
        """The mistake in a sentence that begins with file and line."""
        text = repr(self.value)
        shown = f" = {text}" if self.value is not ABSENT and len(text) <= LONGEST_VALUE and "\n" not in text else ""
        return f"{source.of(self.place)}: {dotted(self.place)}{shown}: {self.expected}"


@dataclass(frozen=True)
class Source:
    """Where the parts of a document were written.

    file : name of the study file, or of the caller that gave the document.
    lines : line of each place in its file.
    files : the file of each place that is written in another one, which this study extends.
    aliases : dotted names that were last set elsewhere (in a sweep, [quick] or --set), and where they were set.
    """

    file: str
    lines: Mapping[Place, int] = field(default_factory=dict)
    files: Mapping[Place, str] = field(default_factory=dict)
    aliases: Mapping[str, str] = field(default_factory=dict)

    def at(self, place: Place) -> str:
        """File and line of a place in the document."""
        written = nearest_place(self.lines, place)
        return self.file if written is None else f"{self.files.get(written, self.file)}, line {self.lines[written]}"

    def of(self, place: Place) -> str:
        """Where the value at a place was set last: in a sweep, [quick] or --set, or on a line of the file."""
        name = dotted(place)
        for alias in sorted(self.aliases, key=len, reverse=True):
            if name == alias or name.startswith(f"{alias}."):
                return self.aliases[alias]
        inside = [where for alias, where in self.aliases.items() if alias.startswith(f"{name}.")]
        return inside[0] if inside and place not in self.lines else self.at(place)


def dotted(place: Place) -> str:
    """A place in dotted form: scene.nodes.spacing, table[0].rows."""
    name = ""
    for part in place:
        name += f"[{part}]" if isinstance(part, int) else f".{part}" if name else part
    return name


def did_you_mean(name: str, names: Iterable[str]) -> str:
    """A question with the nearest valid name; when none is near, the list of valid names."""
    names = list(names)
    nearest = get_close_matches(name, names, n=1)
    return f"did you mean {nearest[0]!r}?" if nearest else f"there are {', '.join(map(repr, names)) or 'none'}"


def moved_name(name: str) -> str | None:
    """What a dotted name of an older study file is called now; None where it has not moved."""
    for old, new in MOVED.items():
        if f"{name}.".startswith(f"{old}."):
            return f"{new}{name.removeprefix(old)}"
    return None


def unknown(place: Place, value: Any, reason: str, names: Iterable[str]) -> Problem:
    """The mistake of an unknown name: its present name when it has been renamed, else `reason` and the nearest name."""
    name = dotted(place)
    if (moved := moved_name(name)) is not None:
        return Problem(place, ABSENT, f"this is called {moved} now")
    return Problem(place, value, f"{reason}; {did_you_mean(str(place[-1]).split('.')[0], names)}")


def problems_in(error: ValidationError, model: type[BaseModel], document: Any) -> list[Problem]:
    """The mistakes that pydantic found, by the places of the document itself; one for each place."""
    found: dict[Place, Problem] = {}
    meant: set[Place] = set()  # what a misspelt name stands for is not missing as well
    for detail in error.errors(include_url=False):
        problem = _problem(detail, model, document)
        if detail["type"] == "extra_forbidden":
            names = _fields_at(model, problem.place[:-1], document)
            meant |= {(*problem.place[:-1], name) for name in get_close_matches(str(problem.place[-1]), names, n=1)}
        earlier = found.get(problem.place)
        if earlier is None:
            found[problem.place] = problem
        elif problem.expected not in earlier.expected:  # each member of a union reports a mistake of its own
            both = f"{earlier.expected} or {problem.expected}"
            found[problem.place] = Problem(problem.place, problem.value, both)
    return [problem for place, problem in found.items() if place not in meant or problem.expected != MISSING]


def _problem(detail: Mapping[str, Any], model: type[BaseModel], document: Any) -> Problem:
    kind, value, context = detail["type"], detail["input"], detail.get("ctx", {})
    place = _place_in(document, detail["loc"], missing=kind in ("missing", "kind_missing", "kind_unknown"))
    if kind == "extra_forbidden":
        names = [name for name in _fields_at(model, place[:-1], document) if name != place[-1]]
        return unknown(place, value, "no such field", names)
    if kind == "missing":
        return Problem(place, ABSENT, MISSING)
    if kind == "kind_missing":
        return Problem((*place, "kind"), ABSENT, detail["msg"])
    if kind == "kind_unknown" and isinstance(value, Mapping):
        return Problem((*place, "kind"), value["kind"], detail["msg"])
    if kind == "union_tag_not_found":
        return Problem((*place, "kind"), ABSENT, MISSING)
    if kind in SHAPES:
        return Problem(place, value, SHAPES[kind])
    if kind == "union_tag_invalid":
        return Problem((*place, "kind"), context["tag"], _choice(context["tag"], context["expected_tags"]))
    if kind == "literal_error":
        return Problem(place, value, _choice(value, context["expected"]))
    message = detail["msg"]
    for beginning in ("Value error, ", "Input ", "String ", "Dictionary "):
        message = message.removeprefix(beginning)
    return Problem(place, value, message)


def _choice(value: object, expected: str) -> str:
    names = [part.strip(" '") for part in expected.replace(" or ", ", ").split(",")]
    guess = get_close_matches(str(value), names, n=1)
    return f"should be {expected}" + (f"; did you mean {guess[0]!r}?" if guess else "")


def _place_in(document: Any, loc: Place, missing: bool) -> Place:
    """The part of pydantic's location that is in the document, without the tags of unions and the names of types."""
    place: list[str | int] = []
    for depth, part in enumerate(loc):
        if _holds(document, part):
            document = document[part]
        elif not (missing and depth == len(loc) - 1):
            continue
        place.append(part)
    return tuple(place)


def _holds(document: Any, part: str | int) -> bool:
    if isinstance(document, list | tuple):
        return isinstance(part, int) and part < len(document)
    return isinstance(document, Mapping) and part in document


def _fields_at(model: type[BaseModel], place: Place, document: Any) -> list[str]:
    """The fields of the model that validates a place in the document."""
    candidates = [model]
    for part in place:
        if isinstance(part, str):
            info = _chosen(candidates, document).model_fields[part]
            candidates = _models_in(info.annotation)
        document = document[part]
    return list(_chosen(candidates, document).model_fields)


def _chosen(candidates: list[type[BaseModel]], document: Any) -> type[BaseModel]:
    """The model whose `kind` the document names, or the class that a table was made from."""
    if isinstance(document, ComponentTable):
        return document.cls
    noun = getattr(candidates[0], "noun", None)
    if noun in CONTRACTS and (named := registry_in_use().class_of(noun, document)) is not None:
        return named
    for candidate in candidates:
        info = candidate.model_fields.get("kind")
        if (
            info is not None
            and isinstance(document, Mapping)
            and document.get("kind", info.default) in get_args(info.annotation)
        ):
            return candidate
    return candidates[0]


def _models_in(annotation: Any) -> list[type[BaseModel]]:
    """The models in a type such as Annotated[A | B, …] or list[A]; for a contract, its installed classes."""
    if isinstance(annotation, type) and issubclass(annotation, Component) and annotation in CONTRACTS.values():
        return list(registry_in_use().classes(annotation.noun).values())
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return [annotation]
    inner = getattr(annotation, "__value__", None)
    parts = get_args(annotation) if inner is None else (inner,)
    return [model for part in parts for model in _models_in(part)]
