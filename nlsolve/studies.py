"""Study file -> validated `Study` -> cases: a question, components by kind, sweeps, and what to show of the results."""

from __future__ import annotations

import hashlib
import itertools
import json
import re
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass, field, fields, replace
from pathlib import Path
from typing import Annotated, Any

from pydantic import BaseModel, ConfigDict, Field, ValidationError, create_model

from nlsolve.algebra import AlgebraicSetup
from nlsolve.columns import RUNS
from nlsolve.component import Component
from nlsolve.costs import Timing
from nlsolve.driver import Budget, StoppingTest
from nlsolve.errors import ABSENT, Problem, Source, StudyError, did_you_mean, problems_in
from nlsolve.figures import FigureSpec
from nlsolve.locate import Place, lines_of
from nlsolve.march import Setup
from nlsolve.outcomes import VARIANT, names_settings
from nlsolve.references import REFERENCE
from nlsolve.registry import CONTRACTS, Registry, load_registry
from nlsolve.start import LOAD, Start
from nlsolve.sweeps import Document, Point, Setting, Sweep, assign_all, leaves, merged, places_of, swept_places
from nlsolve.systems import System
from nlsolve.tables import TableSpec, check

SECTIONS = tuple(part.name for part in fields(Setup))
"""The parts of a study that a case is made of, and that can be swept."""

DEFAULT_KINDS = {"linear": {"kind": "superlu"}, "starter": {"kind": "newton"}, "predictor": {"kind": "previous"}}
"""Sections that may be left out, or written without a kind."""

DEFAULTS_OF_KINDS = {"solver": "refresh", "discretizer": "counterpart"}
"""Sections whose default the kind of another one names, as `default_refresh` and `default_counterpart`."""

OF_A_SYSTEM = tuple(field.name for field in fields(AlgebraicSetup))
"""Those of them that a scene without a flow has: F(u) = 0 knows no law, no discretizer, no way to a first state."""

DEFAULT_KINDS_OF_A_SYSTEM = {"linear": {"kind": "superlu"}, "solver": {"kind": "robust"}}
"""The same where the scene is a system of equations: it may be solved without a choice of the method."""

DIGEST_LETTERS = 12


class Frame(BaseModel):
    """The parts of a study file around its components."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    question: str = Field(min_length=1, description="what the study finds out, in a sentence")
    sweep: tuple[Sweep, ...] = ()
    reference: dict[str, Any] | None = Field(
        None, description="parameters that make a case the reference its velocities are compared with"
    )
    table: tuple[TableSpec, ...] = ()
    figure: tuple[FigureSpec, ...] = ()
    timing: Timing = Timing()
    quick: dict[str, Any] = Field(default_factory=dict, description="what --quick changes")


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


@dataclass(frozen=True)
class Study:
    """A question, the cases that answer it, and the tables and figures to show."""

    name: str
    question: str
    cases: tuple[Case, ...]
    tables: tuple[TableSpec, ...] = ()
    figures: tuple[Any, ...] = ()
    has_quick: bool = False
    timing: Timing = field(default_factory=Timing)

    @classmethod
    def from_toml(
        cls,
        path: str | Path,
        overrides: Mapping[str, Any] | None = None,
        quick: bool = False,
        registry: Registry | None = None,
    ) -> Study:
        """The study in a file. `overrides` are dotted names and values; `quick` applies the file's [quick] first."""
        try:
            text = Path(path).read_text(encoding="utf-8")
            document = tomllib.loads(text)
        except OSError as error:
            raise StudyError(f"{path}: the study cannot be read: {error.strerror}") from error
        except UnicodeDecodeError as error:
            raise StudyError(f"{path}: the study is not UTF-8 text: {error.reason}") from error
        except tomllib.TOMLDecodeError as error:
            raise StudyError(_syntax(str(path), str(error))) from error
        source = Source(str(path), lines_of(text))
        return _Builder(source, document, overrides or {}, quick, registry or load_registry()).study(Path(path).stem)

    @classmethod
    def from_dict(
        cls,
        document: Mapping[str, Any],
        overrides: Mapping[str, Any] | None = None,
        quick: bool = False,
        registry: Registry | None = None,
        name: str = "study",
    ) -> Study:
        """The same from Python; sections may be components."""
        return _Builder(Source(name), document, overrides or {}, quick, registry or load_registry()).study(name)


class _Builder:
    """One study on its way from a document to cases, with all that an error message wants to tell."""

    def __init__(
        self, source: Source, document: Mapping[str, Any], overrides: Mapping[str, Any], quick: bool, registry: Registry
    ) -> None:
        self.registry = registry
        self.document: Document = merged({}, document)
        aliases = {name: source.at(place) for name, place in swept_places(self.document).items()}
        quick_values: Document = {}
        if quick:
            if not isinstance(self.document.get("quick"), dict):
                raise StudyError(f"{source.file}: the study has no [quick] section, so it cannot be run with --quick")
            quick_values = self.document["quick"]
            changed = swept_places(quick_values) | places_of(quick_values)
            aliases |= {name: source.at(("quick", *place)) for name, place in changed.items()}
        self.quick = quick
        self.overrides = {**quick_values, **overrides}
        self.source = Source(source.file, source.lines, aliases | {name: f"{source.file}, --set" for name in overrides})
        self.refuse(assign_all(self.document, self.overrides))
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

    def study(self, name: str) -> Study:
        frame = self.frame()
        cases = self.cases(frame)
        tables, problems = [], []
        for number, spec in enumerate(frame.table):
            found = check(spec, [case.parameters for case in cases])
            if self.quick or (self.overrides and any(problem.place[0] == "paper" for problem in found)):
                spec = spec.with_(paper=None)  # the study is no longer the one the paper's values are for
                found = check(spec, [case.parameters for case in cases])
            tables.append(spec)
            problems += [Problem(("table", number, *wrong.place), wrong.value, wrong.expected) for wrong in found]
        known = list(dict.fromkeys([*RUNS, *(name for case in cases for name in case.parameters)]))
        problems += [
            Problem(("figure", number, name), column, f"no such column of the results; {did_you_mean(column, known)}")
            for number, figure in enumerate(frame.figure)
            for name, columns in figure.columns_of_runs().items()
            for column in columns
            if column not in known
        ]
        if not frame.timing.calibrate:
            lines = [("table", n) for n, spec in enumerate(frame.table) if spec.crossover is not None]
            lines += [("figure", n) for n, spec in enumerate(frame.figure) if spec.kind == "crossover"]
            asked = "a crossover is told from unit costs: set timing = { calibrate = true }"
            problems += [Problem(place, ABSENT, asked) for place in lines]
        self.refuse(problems)
        return Study(name, frame.question, cases, tuple(tables), frame.figure, bool(frame.quick), frame.timing)

    def refuse(self, problems: list[Problem]) -> None:
        self.refuse_sentences([problem.sentence(self.source) for problem in problems])

    def refuse_sentences(self, sentences: list[str]) -> None:
        if sentences:
            raise StudyError(*dict.fromkeys(sentences))

    def frame(self) -> Frame:
        document = {name: value for name, value in self.document.items() if name not in SECTIONS}
        unknown = [name for name in document if name not in Frame.model_fields]
        names = [*Frame.model_fields, *SECTIONS]
        self.refuse(
            [Problem((name,), self.document[name], f"no such section; {did_you_mean(name, names)}") for name in unknown]
        )
        try:
            frame = Frame.model_validate(document)
        except ValidationError as error:
            self.refuse(problems_in(error, Frame, document))
            raise
        swept = [name for sweep in frame.sweep for name in sweep.columns]
        self.refuse(
            [Problem((name,), [], "swept twice") for name in swept if swept.count(name) > 1]
            + [
                Problem((name,), [], f"not a parameter; {did_you_mean(name.split('.')[0], SECTIONS)}")
                for name in swept
                if name.split(".")[0] not in SECTIONS
            ]
        )
        return frame

    def cases(self, frame: Frame) -> tuple[Case, ...]:
        cases: dict[str, Case] = {}
        references: dict[str, Case] = {}
        sentences: list[str] = []
        named = {name for sweep in frame.sweep if sweep.each is not None for name in sweep.columns}
        base = {name: value for name, value in self.document.items() if name in SECTIONS}
        by_hand = {name: value for name, value in self.overrides.items() if name.split(".")[0] in SECTIONS}
        root: Place = ("quick", "sweep") if self.quick and "sweep" in self.document["quick"] else ("sweep",)
        for points in itertools.product(*(sweep.points((*root, number)) for number, sweep in enumerate(frame.sweep))):
            try:
                case = self.combined(base, points, by_hand, named)
                if frame.reference is not None:
                    reference = self.reference(frame.reference, base, points, by_hand, named)
                    case = replace(case, reference=references.setdefault(reference.id, reference).id)
            except _Refused as refused:
                sentences += refused.sentences
                continue
            source = self.source_of(points, named, by_hand)
            twin = cases.setdefault(case.id, case)  # what is set by hand may make two cases one
            names = [
                ", ".join(word for name, word in each.parameters.items() if names_settings(name))
                for each in (twin, case)
            ]
            if names[0] != names[1]:
                hand = " with what is set by hand" if by_hand else ""
                same = f"{names[0]!r} and {names[1]!r} are one and the same case{hand}: change one of them, or drop it"
                place = next(point.place for point in points if point.name)
                sentences.append(Problem(place, ABSENT, same).sentence(source))
        self.refuse_sentences(sentences)
        cases = references | cases  # first, so that all others can be compared with them as they end
        everyone = [case.parameters for case in cases.values()]
        differing = {
            name
            for parameters in everyone
            for name, value in parameters.items()
            if any(name in other and other[name] != value for other in everyone)  # one kind's own defaults tell nothing
        }
        return tuple(
            replace(case, swept=tuple(name for name in case.swept if name in differing)) for case in cases.values()
        )

    def combined(self, base: Document, points: tuple[Point, ...], by_hand: Mapping[str, Any], named: set[str]) -> Case:
        """The case of one combination, the hand winning. Raises _Refused with sentences."""
        source = self.source_of(points, named, by_hand)
        assigned = {name: value for point in points for name, value in point.values.items()}
        document = merged({}, base)
        sections_first = dict(sorted(assigned.items(), key=lambda item: item[0].count(".")))
        wrong = assign_all(document, sections_first) + assign_all(document, by_hand)
        if wrong:
            raise _Refused([problem.sentence(source) for problem in wrong])
        try:
            return self.case(document, points)
        except _Invalid as invalid:
            raise _Refused([problem.sentence(source) for problem in invalid.problems]) from invalid

    def reference(
        self,
        table: Mapping[str, Any],
        base: Document,
        points: tuple[Point, ...],
        by_hand: Mapping[str, Any],
        named: set[str],
    ) -> Case:
        """The same combination as the reference has it: what its table sets, nobody else does."""
        column = next((point.column for point in points if point.name), VARIANT)
        made = Setting.model_validate({"name": REFERENCE, **table}).point((REFERENCE,), column)

        def others(values: Mapping[str, Any]) -> dict[str, Any]:
            return {
                name: value
                for name, value in values.items()
                if not any(f"{name}.".startswith(f"{settled}.") for settled in made.values)
            }

        left = tuple(replace(point, values=others(point.values), name="") for point in points)
        if not any(point.name for point in points):
            made = replace(made, name="")
        return self.combined(base, (*left, made), others(by_hand), named | set(made.values))

    def source_of(self, points: tuple[Point, ...], named: set[str], by_hand: Mapping[str, Any]) -> Source:
        """Where the values of one combination were written; the hand wins here too."""
        hand = dict(leaves(by_hand))
        known = {name: where for name, where in self.source.aliases.items() if name in hand or name not in named}
        mine = {name: place for point in points for name, place in point.places.items() if name not in hand}
        return replace(self.source, aliases=known | {name: self.source.at(place) for name, place in mine.items()})

    def case(self, document: Document, points: tuple[Point, ...]) -> Case:
        """Validate one combination. Raises _Invalid."""
        of_a_system = issubclass(self.named(document, "scene"), System)
        sections, model = (OF_A_SYSTEM, self.model_of_a_system) if of_a_system else (SECTIONS, self.model)
        needless = [name for name in document if name not in sections]
        if needless:
            sentence = "a scene that is a system of equations has no such section: leave it out"
            raise _Invalid([Problem((name,), ABSENT, sentence) for name in needless])
        for section, default in (DEFAULT_KINDS_OF_A_SYSTEM if of_a_system else DEFAULT_KINDS).items():
            self.complete(document, section, default)
        for noun, section in DEFAULTS_OF_KINDS.items():
            if section not in sections:
                continue
            of_its_kind = getattr(self.named(document, noun), f"default_{section}", None)
            if of_its_kind is not None:
                self.complete(document, section, of_its_kind)
        try:
            composition = model.model_validate(document)
        except ValidationError as error:
            raise _Invalid(problems_in(error, model, document)) from error
        chosen = {name: getattr(composition, name) for name in sections}
        setup = AlgebraicSetup(**chosen) if of_a_system else Setup(**chosen)
        if setup.stop.kind == "claim" and not setup.solver.claims:
            sentence = f"the solver {setup.solver.kind_name()!r} never claims a solution; use residual or difference"
            raise _Invalid([Problem(("stop", "kind"), "claim", sentence)])
        if isinstance(setup, Setup):
            self.check_continuation(setup)
        plain = json.loads(composition.model_dump_json())
        canonical = json.dumps(plain, sort_keys=True, separators=(",", ":"))
        digest = hashlib.sha256(canonical.encode()).hexdigest()[:DIGEST_LETTERS]
        parameters = {
            name: json.dumps(value) if isinstance(value, list | dict) else value for name, value in leaves(plain)
        }
        swept = [name for point in points if not point.name for name in point.values]
        names = tuple(
            parameter
            for parameter in parameters
            if any(parameter == name or parameter.startswith(f"{name}.") for name in swept)
        )
        named: dict[str, str] = {}
        for point in points:
            if point.name:
                named[point.column] = ", ".join(filter(None, (named.get(point.column), point.name)))
        parameters, names = {**named, **parameters}, (*named, *names)
        return Case(digest, setup, parameters, names)

    def check_continuation(self, setup: Setup) -> None:
        """Refuse a way to the first state that the law cannot go."""
        try:
            setup.start.stages(setup.law)
        except ValidationError as error:
            reasons = "; ".join(detail["msg"] for detail in error.errors())
            raise _Invalid(
                [Problem(("start", "values"), list(setup.start.values), f"refused by the law: {reasons}")]
            ) from error
        except ValueError as error:
            field = "values" if setup.start.by == LOAD else "by"
            reason = str(error).partition(": ")[2]
            raise _Invalid([Problem(("start", field), getattr(setup.start, field), reason)]) from error

    def named(self, document: Document, section: str) -> type[Component]:
        """The installed class that a section names, or is; Component itself where there is none."""
        given = document.get(section)
        if isinstance(given, Component):
            return type(given)
        kind = given.get("kind") if isinstance(given, dict) else None
        return self.registry.classes(section).get(kind, Component) if isinstance(kind, str) else Component

    def complete(self, document: Document, section: str, default: Mapping[str, Any]) -> None:
        """Give a section that names no kind its default."""
        given = document.get(section, {})
        if isinstance(given, dict) and "kind" not in given:
            document[section] = {**default, **given}


class _Invalid(Exception):
    """What is wrong with a document that does not make a case."""

    def __init__(self, problems: list[Problem]) -> None:
        super().__init__()
        self.problems = problems


class _Refused(Exception):
    """A combination that does not make a case, in sentences with their places."""

    def __init__(self, sentences: list[str]) -> None:
        super().__init__()
        self.sentences = sentences


def _syntax(path: str, message: str) -> str:
    found = re.search(r"\(at line (\d+), column (\d+)\)", message)
    where = f", line {found[1]}, column {found[2]}" if found else ""
    return f"{path}{where}: not valid TOML: {message.split(' (at ')[0]}"
