"""Study file -> validated `Study` -> cases: a question, components by kind, sweeps, and what to show of the results."""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from nlsolve.contracts import notebook
from nlsolve.registry.plugin_files import with_plugins
from nlsolve.registry.problems import ABSENT, Problem, Source, StudyError, problems_in, unknown
from nlsolve.registry.registry import Registry, load_registry
from nlsolve.registry.toml_lines import Place
from nlsolve.results.columns import RUNS, is_measured, no_such_column
from nlsolve.results.parameters import VARIANT, names_settings
from nlsolve.results.reference_error import REFERENCE
from nlsolve.show.expectations import Expectation
from nlsolve.show.figures import BaseFigure, FigureSpec, Look
from nlsolve.show.tables import PREAMBLE_FILE, TableSpec, check
from nlsolve.study.case import Case, Composer, Invalid
from nlsolve.study.documents import EXTENDS, PLUGINS, command_of, read_document
from nlsolve.study.exclusions import Exclude, Excluded, Exclusions
from nlsolve.study.sweeps import Document, Point, Setting, Sweep, assign_all, leaves, merged, places_of, swept_places
from nlsolve.study.timing import Timing


class Frame(BaseModel):
    """The entries of a study file that are not sections of its cases."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    extends: str | None = Field(
        None,
        description="path of a study, relative to this file, over whose entries those of this file are merged: tables "
        "key by key, while a table with a kind, a list and any other value replace what was there",
    )
    plugins: tuple[str, ...] = Field(
        (), description="plugins of one file, by their paths relative to this file; all their components can be used"
    )
    question: str = Field(min_length=1, description="what the study finds out, in a sentence")
    sweep: tuple[Sweep, ...] = Field((), description="what varies between the cases; several sweeps multiply")
    exclude: tuple[Exclude, ...] = Field((), description="cases that are left out, with reasons")
    reference: dict[str, Any] | None = Field(
        None, description="parameters that make a case the reference its velocities are compared with"
    )
    table: tuple[TableSpec, ...] = Field((), description="tables of the results")
    figure: tuple[FigureSpec, ...] = Field((), description="figures of the results")
    figures: Look = Field(Look(), description="width, fonts and files of all figures that say nothing else themselves")
    expect: tuple[Expectation, ...] = Field(
        (), description="findings that the study asserts; exit code 3 of `nlsolve run` says that one does not hold"
    )
    timing: Timing = Field(Timing(), description="how the cases are timed")
    quick: dict[str, Any] = Field(
        default_factory=dict, description="dotted parameters, and entries such as sweep, that --quick changes"
    )


@dataclass(frozen=True, repr=False)
class Study:
    """A question, the cases that answer it, and the tables and figures to show.

    has_quick : whether the study has a [quick] section, which `quick=True` and --quick apply.
    plugins : the files of plugins without installation whose components its cases may have.
    figures : the declared figures, what they do not say of their look as `[figures]` says.
    excluded : the cases that the study leaves out.
    command : what runs it from the command line; empty for a study that is not in a file.
    expectations : what the study asserts of its results; of a quick study, what its [quick] section asserts.
    """

    name: str
    question: str
    cases: tuple[Case, ...]
    tables: tuple[TableSpec, ...] = ()
    figures: tuple[Any, ...] = ()
    has_quick: bool = False
    timing: Timing = field(default_factory=Timing)
    plugins: tuple[Path, ...] = ()
    excluded: tuple[Excluded, ...] = ()
    expectations: tuple[Expectation, ...] = ()
    command: str = ""

    @classmethod
    def from_toml(
        cls,
        path: str | Path,
        overrides: Mapping[str, Any] | None = None,
        quick: bool = False,
        registry: Registry | None = None,
    ) -> Study:
        """The study in a TOML file. `overrides` maps dotted names ("solver.order") to values; `quick` applies the
        file's [quick] section before them.

        Raises StudyError with a sentence for each mistake: its line, its place, its value, and what is expected.
        """
        document, source = read_document(Path(path))
        study = _built(source, document, overrides or {}, quick, registry or load_registry(), Path(path).stem)
        plugins = () if registry is None else registry.files
        return replace(study, command=command_of(path, overrides or {}, quick, plugins))

    @classmethod
    def from_dict(
        cls,
        document: Mapping[str, Any],
        overrides: Mapping[str, Any] | None = None,
        quick: bool = False,
        registry: Registry | None = None,
        name: str = "study",
    ) -> Study:
        """The study in a dictionary. Its sections and swept values may be component instances, installed or not, and
        its `plugins` classes, whose kinds can then be written.

        Raises StudyError as `from_toml` does.
        """
        return _built(Source(name), document, overrides or {}, quick, registry or load_registry(), name)

    def __repr__(self) -> str:
        return "\n".join(f"{name:<8}  {text}" for name, text in self._told().items())

    def _repr_html_(self) -> str:
        """What a notebook shows: the question, the number of cases and what varies, tables and figures."""
        return notebook.facts(self._told())

    def _told(self) -> dict[str, str]:
        swept = dict.fromkeys(name for case in self.cases for name in case.swept)
        told = {
            "study": self.name,
            "question": self.question,
            "cases": f"{len(self.cases)}" + (f", {len(self.excluded)} left out" if self.excluded else ""),
            "swept": ", ".join(swept),
            "tables": ", ".join(table.name for table in self.tables),
            "figures": ", ".join(figure.name for figure in self.figures),
            "expects": f"{len(self.expectations)} findings" if self.expectations else "",
        }
        return {name: text for name, text in told.items() if text}


def _built(
    source: Source,
    document: Mapping[str, Any],
    overrides: Mapping[str, Any],
    quick: bool,
    registry: Registry,
    name: str,
) -> Study:
    """The study of a document, in which components inside components are those of the same registry."""
    given = document.get(PLUGINS, [])
    plugins = given if isinstance(given, list | tuple) else []
    for number, plugin in enumerate(plugins):
        try:
            registry = with_plugins(registry, [plugin] if isinstance(plugin, str | type) else [])
        except StudyError as error:
            raise StudyError(f"{source.at((PLUGINS, number))}: {PLUGINS}[{number}]: {error}") from error
    if any(isinstance(plugin, type) for plugin in plugins):  # taken up; the others are checked with all other entries
        document = {**document, PLUGINS: [plugin for plugin in plugins if not isinstance(plugin, type)]}
    with registry.in_use():
        return _Builder(source, document, overrides, quick, registry).study(name)


class _Builder:
    """Builds one study from a document; knows where each value was written, for the sentences of errors."""

    def __init__(
        self, source: Source, document: Mapping[str, Any], overrides: Mapping[str, Any], quick: bool, registry: Registry
    ) -> None:
        self.document: Document = merged({}, document)
        self.composer = Composer(registry, self.document, overrides)
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
        by_hand = {name: f"{source.file}, --set" for name in overrides}
        self.source = replace(source, aliases=aliases | by_hand)
        self.refuse(assign_all(self.document, self.overrides))

    def study(self, name: str) -> Study:
        frame = self.frame()
        cases, excluded = self.cases(frame)
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
            Problem(("figure", number, name), column, no_such_column(column, known))
            for number, figure in enumerate(frame.figure)
            for name, columns in figure.columns_of_runs().items()
            for column in columns
            if column not in known and not is_measured(column)
        ]
        problems += _called_alike("table", frame.table) + _called_alike("figure", frame.figure)
        expectations = frame.expect if not self.quick or "expect" in self.document["quick"] else ()
        names = [spec.name for spec in frame.table]
        problems += [
            Problem(("expect", number, *wrong.place), wrong.value, wrong.expected)
            for number, expectation in enumerate(expectations)
            for wrong in expectation.problems(known, names)
        ]
        if not frame.timing.calibrate:
            lines = [("table", n) for n, spec in enumerate(frame.table) if spec.crossover is not None]
            lines += [("figure", n) for n, spec in enumerate(frame.figure) if spec.kind == "crossover"]
            asked = "a crossover is told from unit costs: set timing = { calibrate = true }"
            problems += [Problem(place, ABSENT, asked) for place in lines]
        self.refuse(problems)
        return Study(
            name,
            frame.question,
            cases,
            tuple(tables),
            tuple(figure.under(frame.figures) for figure in frame.figure),
            has_quick=bool(frame.quick),
            timing=frame.timing,
            plugins=self.composer.registry.files,
            excluded=excluded,
            expectations=expectations,
        )

    def refuse(self, problems: list[Problem]) -> None:
        self.refuse_sentences([problem.sentence(self.source) for problem in problems])

    def refuse_sentences(self, sentences: list[str]) -> None:
        if sentences:
            raise StudyError(*dict.fromkeys(sentences))

    def frame(self) -> Frame:
        document = {name: value for name, value in self.document.items() if name not in self.composer.sections}
        strange = [name for name in document if name not in Frame.model_fields]
        names = [*Frame.model_fields, *self.composer.sections]
        self.refuse([unknown((name,), self.document[name], "no such section", names) for name in strange])
        if EXTENDS in document:
            sentence = "a study in a dictionary extends none: merge the dictionaries, or write a study file"
            self.refuse([Problem((EXTENDS,), document[EXTENDS], sentence)])
        try:
            frame = Frame.model_validate(document)
        except ValidationError as error:
            self.refuse(problems_in(error, Frame, document))
            raise
        swept = [name for sweep in frame.sweep for name in sweep.columns]
        self.refuse(
            [Problem((name,), [], "swept twice") for name in swept if swept.count(name) > 1]
            + [
                unknown((name,), [], "not a parameter", self.composer.sections)
                for name in swept
                if name.split(".")[0] not in self.composer.sections
            ]
        )
        return frame

    def cases(self, frame: Frame) -> tuple[tuple[Case, ...], tuple[Excluded, ...]]:
        exclusions, known = Exclusions(frame.exclude), set[str]()
        cases: dict[str, Case] = {}
        references: dict[str, Case] = {}
        sentences: list[str] = []
        named = {name for sweep in frame.sweep if sweep.each is not None for name in sweep.columns}
        base = {name: value for name, value in self.document.items() if name in self.composer.sections}
        by_hand = {
            name: value for name, value in self.overrides.items() if name.split(".")[0] in self.composer.sections
        }
        root: Place = ("quick", "sweep") if self.quick and "sweep" in self.document["quick"] else ("sweep",)
        for points in itertools.product(*(sweep.points((*root, number)) for number, sweep in enumerate(frame.sweep))):
            label = ", ".join(point.label for point in points)
            try:
                case = self.combined(base, points, by_hand, named)
                known |= case.parameters.keys()
                if exclusions.hit(case.parameters, label):
                    continue
                if frame.reference is not None:
                    reference = self.reference(frame.reference, base, points, by_hand, named)
                    case = replace(case, reference=references.setdefault(reference.id, reference).id)
            except _Refused as refused:
                known |= refused.parameters.keys()
                if exclusions.hit(refused.parameters, label):
                    continue
                sentences += refused.sentences
                continue
            twin = cases.setdefault(case.id, case)  # overrides may make two cases one
            if twin is not case and (names := [_settings_of(twin), _settings_of(case)]) != names[:1] * 2:
                hand = " with what is set by hand" if by_hand else ""
                same = f"{names[0]!r} and {names[1]!r} are one and the same case{hand}: change one of them, or drop it"
                place = next(point.place for point in points if point.name)
                sentences.append(Problem(place, ABSENT, same).sentence(self.source_of(points, named, by_hand)))
        self.refuse_sentences(sentences)
        if not self.overrides:  # a study that is changed by hand or by [quick] may have fewer cases
            self.refuse(exclusions.idle(known))
        if not cases:
            self.refuse([Problem(("exclude",), ABSENT, "no case is left")])
        cases = references | cases  # references first: the other cases are compared with them as they end
        differing = _differing([case.parameters for case in cases.values()])
        shown = (
            replace(case, swept=tuple(name for name in case.swept if name in differing)) for case in cases.values()
        )
        return tuple(shown), tuple(exclusions.found)

    def combined(self, base: Document, points: tuple[Point, ...], by_hand: Mapping[str, Any], named: set[str]) -> Case:
        """The case of one combination of points; overrides replace their values. Raises _Refused with sentences."""
        assigned = {name: value for point in points for name, value in point.values.items()}
        document = merged({}, base)
        sections_first = dict(sorted(assigned.items(), key=lambda item: item[0].count(".")))
        wrong = assign_all(document, sections_first) + assign_all(document, by_hand)
        try:
            if wrong:
                raise Invalid(wrong)
            return self.composer.case(document, points)
        except Invalid as invalid:
            source = self.source_of(points, named, by_hand)
            settings = {point.column: point.name for point in points if point.name}
            sentences = [problem.sentence(source) for problem in invalid.problems]
            raise _Refused(sentences, {**settings, **_written(document)}) from invalid

    def reference(
        self,
        table: Mapping[str, Any],
        base: Document,
        points: tuple[Point, ...],
        by_hand: Mapping[str, Any],
        named: set[str],
    ) -> Case:
        """The reference case of one combination of points; neither points nor overrides replace what `table` sets."""
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
        """Where the values of one combination were written; for a value that is overridden, --set or [quick]."""
        hand = dict(leaves(by_hand))
        known = {name: where for name, where in self.source.aliases.items() if name in hand or name not in named}
        mine = {name: place for point in points for name, place in point.places.items() if name not in hand}
        return replace(self.source, aliases=known | {name: self.source.at(place) for name, place in mine.items()})


class _Refused(Exception):
    """Raised for a combination that does not make a case.

    sentences : why, each with its place.
    parameters : the values that were written, by dotted name.
    """

    def __init__(self, sentences: list[str], parameters: Mapping[str, Any]) -> None:
        super().__init__()
        self.sentences, self.parameters = sentences, parameters


def _written(document: Document) -> dict[str, Any]:
    """The values of a document by dotted name; a word may be short for a table with that kind."""
    written = dict(leaves(document))
    return {f"{name}.kind": value for name, value in written.items() if isinstance(value, str)} | written


def _settings_of(case: Case) -> str:
    """The names of the settings that a case was made by."""
    return ", ".join(word for name, word in case.parameters.items() if names_settings(name))


def _called_alike(noun: str, specs: Sequence[TableSpec | BaseFigure]) -> list[Problem]:
    """A problem for each table or figure whose files would replace those of an earlier one, or the preamble."""
    problems, names = [], set[str]()
    for number, spec in enumerate(specs):
        stems = {spec.name.casefold()}
        if isinstance(spec, TableSpec):
            stems |= {f"{spec.name}-paper".casefold()} if spec.paper is not None else set()
            if spec.name.casefold() == Path(PREAMBLE_FILE).stem:
                sentence = f"the file {PREAMBLE_FILE} beside the tables has this name; choose another"
                problems.append(Problem((noun, number, "name"), spec.name, sentence))
        if stems & names:
            sentence = f"another {noun} has this name, perhaps in other letter case; its files would be replaced"
            problems.append(Problem((noun, number, "name"), spec.name, sentence))
        names |= stems
    return problems


def _differing(everyone: Sequence[Mapping[str, Any]]) -> set[str]:
    """The parameters of which two cases that have them hold different values: the defaults of one kind tell no cases
    apart."""
    first: dict[str, Any] = {}
    differing: set[str] = set()
    for parameters in everyone:
        for name, value in parameters.items():
            if name not in differing and first.setdefault(name, value) != value:
                differing.add(name)
    return differing
