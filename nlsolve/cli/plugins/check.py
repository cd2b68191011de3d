"""`nlsolve check KIND_OR_FILE`: the conformance kit from the shell."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Annotated, Any

import typer
from pydantic import ValidationError
from rich.markup import escape
from rich.table import Table

from nlsolve.cli.endings import ExitCode, ending
from nlsolve.cli.options import Disabled, Json, PluginFiles, registry_of
from nlsolve.cli.printing import say, stdout
from nlsolve.contracts.component import Component
from nlsolve.registry.plugin_files import with_files
from nlsolve.registry.problems import StudyError, did_you_mean
from nlsolve.registry.registry import CONTRACTS, Registry
from nlsolve.study.sweeps import parse_assignments
from nlsolve.testing.kit.subjects import contract_of, verdicts_of
from nlsolve.testing.kit.verdicts import Verdict

PAGE = "docs/plugins.md"
"""Where the promises of every contract are explained."""

REGISTERED = "registered"
"""The name of the promise that a file can be imported and its classes registered."""


@dataclass(frozen=True)
class Checked:
    """A component that was checked: its noun and kind, where to read on, and what was found."""

    noun: str
    kind: str
    see: str
    verdicts: tuple[Verdict, ...]

    @property
    def holds(self) -> bool:
        """Whether every promise holds."""
        return all(verdict.holds for verdict in self.verdicts)


def check(
    subjects: Annotated[
        list[str], typer.Argument(metavar="KIND_OR_FILE…", help="installed kinds, or files with plugins (.py)")
    ],
    plugin: PluginFiles = None,
    disable_plugin: Disabled = None,
    settings: Annotated[
        list[str] | None, typer.Option("--set", metavar="FIELD=VALUE", help="a field of what is checked, such as m=3")
    ] = None,
    as_json: Json = False,
) -> None:
    """Hold plugins to their contracts: a table of promises, and a sentence for each that is broken.

    Exit code 0: all hold; 1: one is broken; 2: there is no such kind or file.
    """
    with ending():
        registry = registry_of(plugin, disable_plugin)
        fields = parse_assignments(settings or [])
        found = [checked for subject in subjects for checked in _checked(subject, registry, fields)]
    if as_json:
        typer.echo(json.dumps([asdict(checked) | {"holds": checked.holds} for checked in found], ensure_ascii=False))
    else:
        for checked in found:
            _print(checked)
    broken = [checked for checked in found if not checked.holds]
    for checked in broken:
        names = ", ".join(verdict.name for verdict in checked.verdicts if verdict.failure)
        say(f"{checked.noun} {checked.kind}: does not keep its contract: {names}; see {checked.see}")
    if broken:
        raise typer.Exit(ExitCode.BROKEN)


def _checked(subject: str, registry: Registry, fields: Mapping[str, Any]) -> Iterator[Checked]:
    """The components of a file, or of a kind of whatever contract. Raises StudyError when there is none."""
    path = Path(subject)
    if path.suffix == ".py" or path.is_file():
        if not path.is_file():
            raise StudyError(f"the plugin {path} cannot be read: there is no such file")
        try:
            wider = with_files(registry, [path])
        except StudyError as error:
            failed = Verdict(REGISTERED, "the file can be imported, and its classes registered", str(error))
            yield Checked("file", path.name, f"{PAGE}#one-file-is-a-plugin", (failed,))
            return
        known = {cls for noun in CONTRACTS for cls in registry.offered(noun, absent_too=True).values()}
        classes = [
            (name, cls)
            for noun in CONTRACTS
            for name, cls in wider.offered(noun, absent_too=True).items()
            if cls not in known
        ]
    else:
        wider = registry
        classes = [(subject, cls) for noun in CONTRACTS if (cls := registry.class_called(noun, subject)) is not None]
    if not classes:
        kinds = sorted({kind for noun in CONTRACTS for kind in registry.classes(noun)})
        raise StudyError(f"{subject}: no plugin offers this kind; {did_you_mean(subject, kinds)}")
    strange = [name for name in fields if not any(name in cls.model_fields for _, cls in classes)]
    if strange:
        raise StudyError(f"--set {strange[0]}: {subject} has no such field")
    with wider.in_use():
        for kind, cls in classes:
            own = {name: value for name, value in fields.items() if name in cls.model_fields}
            contract = contract_of(cls).__name__.lower()
            yield Checked(cls.noun, kind, f"{PAGE}#{contract}", verdicts_of(_made(kind, cls, own)))


def _made(kind: str, cls: type[Component], fields: Mapping[str, Any]) -> Component:
    """An instance with these fields, and defaults. Raises StudyError where a field is missing or wrong."""
    try:
        return cls(**fields)
    except ValidationError as error:
        first = error.errors()[0]
        name = ".".join(map(str, first["loc"]))
        raise StudyError(f"{kind}: {name}: {first['msg']}: give it by --set {name}=VALUE") from error


def _print(checked: Checked) -> None:
    """Print the table of one component on standard output."""
    table = Table(title=escape(f"{checked.noun} {checked.kind}"), title_justify="left", show_lines=False)
    table.add_column("check", no_wrap=True)
    table.add_column("", no_wrap=True)
    table.add_column("promise, and how it is broken", overflow="fold")
    for verdict in checked.verdicts:
        mark = "passed" if verdict.holds else "FAILED" if verdict.failure else "not reached"
        text = f"{verdict.failure} (see {checked.see})" if verdict.failure else verdict.meaning
        table.add_row(escape(verdict.name), mark, escape(text))
    stdout().print(table)
