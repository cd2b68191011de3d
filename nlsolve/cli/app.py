"""The commands of the command line: run, validate, plan, diagnose, plugins, table."""

from __future__ import annotations

import json
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import asdict
from enum import IntEnum
from importlib.metadata import version
from pathlib import Path
from typing import Annotated

import typer
from pydantic_core import to_jsonable_python
from rich.console import Console

from nlsolve.cli.disabling import disable
from nlsolve.cli.printing import (
    count,
    left_out,
    print_frame,
    print_plugins,
    print_results,
    print_table,
    say,
    say_endings,
    say_excluded,
)
from nlsolve.cli.progress import Watch
from nlsolve.registry.plugin_files import with_files
from nlsolve.registry.problems import StudyError, did_you_mean
from nlsolve.registry.registry import Registry, load_registry
from nlsolve.results.frames import json_rows
from nlsolve.running.diagnose import diagnose as diagnostics_of
from nlsolve.running.forecast import ASSUMPTION, forecast
from nlsolve.running.runner import run as run_study
from nlsolve.running.store import StoreError, read_tables
from nlsolve.show.tables import build
from nlsolve.study.case import section_rows
from nlsolve.study.keys.schema import study_schema
from nlsolve.study.study import Study
from nlsolve.study.sweeps import parse_assignments


class ExitCode(IntEnum):
    """The exit codes of the commands."""

    COMPLETE = 0
    CRASHED = 1
    INVALID = 2
    NOT_FOUND = 3
    INTERRUPTED = 130


app = typer.Typer(
    help="Compare nonlinear solution strategies on equal terms.", no_args_is_help=True, pretty_exceptions_enable=False
)

StudyFile = Annotated[Path, typer.Argument(metavar="STUDY", help="a study file (TOML)")]
Settings = Annotated[
    list[str] | None, typer.Option("--set", metavar="KEY=VALUE", help="set a parameter, such as solver.order=20")
]
Quick = Annotated[bool, typer.Option("--quick", help="the shrunk study of the file's [quick] section")]
PluginFiles = Annotated[
    list[Path] | None,
    typer.Option("--plugin", metavar="FILE", help="a plugin of one file, beside those that the study names"),
]
Disabled = Annotated[
    list[str] | None,
    typer.Option("--disable-plugin", metavar="NAME", help="a plugin, or a package of plugins, that is not imported"),
]
Json = Annotated[bool, typer.Option("--json", help="machine-readable output")]


@app.callback()
def common(
    _version: Annotated[
        bool, typer.Option("--version", is_eager=True, callback=lambda asked: show_version(asked), help="and exit")
    ] = False,
) -> None:
    """Compare nonlinear solution strategies on equal terms."""


def show_version(asked: bool) -> None:
    """Print the version and exit, when asked."""
    if asked:
        typer.echo(f"nlsolve {version('nlsolve')}")
        raise typer.Exit


@app.command()
def run(
    study: StudyFile,
    out: Annotated[
        Path | None, typer.Option(help="results folder; default: results/NAME or results/NAME-quick")
    ] = None,
    settings: Settings = None,
    quick: Quick = False,
    plugin: PluginFiles = None,
    disable_plugin: Disabled = None,
    as_json: Json = False,
) -> None:
    """Run a study, or the part of it that is not yet in the results folder."""
    folder = out or Path("results") / (study.stem + ("-quick" if quick else ""))
    console = Console(stderr=True)
    with ending(folder):
        registry = registry_of(plugin, disable_plugin)
        checked = Study.from_toml(study, parse_assignments(settings or []), quick, registry)
        with Watch(console) as watch:
            results = run_study(checked, folder, listen=watch)
    print_results(results, as_json)
    say_excluded(checked)
    for line in (*left_out(results.runs), *results.notes):
        say(line)
    for finding in results.findings:
        say(str(finding))
    say_endings(results)
    if results.crashed:
        raise typer.Exit(ExitCode.CRASHED)
    if not all(finding.holds for finding in results.findings):
        raise typer.Exit(ExitCode.NOT_FOUND)


@app.command()
def validate(
    study: StudyFile,
    settings: Settings = None,
    plugin: PluginFiles = None,
    disable_plugin: Disabled = None,
    as_json: Json = False,
) -> None:
    """Check a study, and its quick form if it has one, without running it."""
    with ending():
        overrides, registry = parse_assignments(settings or []), registry_of(plugin, disable_plugin)
        checked = Study.from_toml(study, overrides, registry=registry)
        quick = Study.from_toml(study, overrides, quick=True, registry=registry) if checked.has_quick else None
    found = {"study": checked.name, "question": checked.question, "cases": len(checked.cases)}
    found |= {"quick_cases": len(quick.cases)} if quick else {}
    found |= {"excluded": [asdict(excluded) for excluded in checked.excluded]} if checked.excluded else {}
    if as_json:
        typer.echo(json.dumps(found))
    else:
        extra = f" ({len(quick.cases)} with --quick)" if quick else ""
        say_excluded(checked)
        typer.echo(f"{study} is valid: {count(len(checked.cases))}{extra}. {checked.question}")


@app.command()
def plan(
    study: StudyFile,
    settings: Settings = None,
    quick: Quick = False,
    plugin: PluginFiles = None,
    disable_plugin: Disabled = None,
    as_json: Json = False,
) -> None:
    """List the cases of a study and forecast what they cost."""
    with ending():
        registry = registry_of(plugin, disable_plugin)
        checked = Study.from_toml(study, parse_assignments(settings or []), quick, registry)
        frame = forecast(checked)
    if as_json:
        typer.echo(json.dumps({"assumption": ASSUMPTION, "cases": json_rows(frame)}))
        return
    swept = list(dict.fromkeys(name for case in checked.cases for name in case.swept))
    sizes = ["increments", "nodes", "unknowns", "seconds_factorization", "seconds_start", "seconds", "seconds_all"]
    say_excluded(checked)
    print_frame(count(len(frame)), frame[["case", *swept, *sizes]])
    typer.echo(f"{frame['seconds_all'].sum() * checked.timing.rounds:.3g} s in all ({ASSUMPTION})")


@app.command()
def diagnose(
    study: StudyFile,
    settings: Settings = None,
    quick: Quick = False,
    plugin: PluginFiles = None,
    disable_plugin: Disabled = None,
    as_json: Json = False,
) -> None:
    """Measure the operators on the clouds of a study: supports, balance, reproduction, largest weight."""
    with ending():
        registry = registry_of(plugin, disable_plugin)
        frame = diagnostics_of(Study.from_toml(study, parse_assignments(settings or []), quick, registry))
    if as_json:
        typer.echo(json.dumps(json_rows(frame)))
    else:
        print_frame("Operators, one row each", frame)


@app.command()
def plugins(plugin: PluginFiles = None, disable_plugin: Disabled = None, as_json: Json = False) -> None:
    """List the sections of a study and what is installed for them, with parameters, and what failed to load."""
    with ending():
        registry = registry_of(plugin, disable_plugin)
    rows = [*section_rows(registry), *registry.plugins()]
    if as_json:
        typer.echo(json.dumps(to_jsonable_python([asdict(row) for row in rows])))
        return
    print_plugins(rows)


@app.command()
def schema(plugin: PluginFiles = None, disable_plugin: Disabled = None) -> None:
    """Print the JSON schema of study files, composed from the installed plugins."""
    with ending():
        registry = registry_of(plugin, disable_plugin)
    typer.echo(json.dumps(study_schema(registry), indent=1, ensure_ascii=False))


@app.command()
def table(
    folder: Annotated[Path, typer.Argument(metavar="DIR", help="a results folder")],
    name: Annotated[str | None, typer.Argument(help="one declared table; default: all")] = None,
    as_json: Json = False,
) -> None:
    """Print the declared tables of a results folder."""
    with ending():
        specs, runs = read_tables(folder)
        names = [spec.name for spec in specs]
        if name is not None and name not in names:
            raise StudyError(f"{folder}: there is no table {name!r}; {did_you_mean(name, names)}")
        tables = [build(spec, runs) for spec in specs if name in (None, spec.name)]
    if as_json:
        typer.echo(json.dumps({table.spec.name: table.long() for table in tables}))
        return
    for declared in tables:
        print_table(declared)


def registry_of(files: list[Path] | None, disabled: list[str] | None) -> Registry:
    """The installed plugins but those disabled, and those of files. Raises StudyError for one that cannot be used."""
    disable(disabled or [])
    return with_files(load_registry(), files or [])


@contextmanager
def ending(folder: Path | None = None) -> Iterator[None]:
    """Turn invalid input and an interruption into a sentence on standard error and an exit code."""
    try:
        yield
    except (StudyError, StoreError) as error:
        say(str(error))
        raise typer.Exit(ExitCode.INVALID) from error
    except KeyboardInterrupt as error:
        kept = f"; the finished cases are in {folder} and the same command does the rest" if folder else ""
        say(f"interrupted{kept}")
        raise typer.Exit(ExitCode.INTERRUPTED) from error
