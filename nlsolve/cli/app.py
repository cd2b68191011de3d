"""The commands on studies: run, validate, plan, diagnose; and the list of plugins."""

from __future__ import annotations

import json
from dataclasses import asdict
from importlib.metadata import version
from typing import Annotated

import typer
from pydantic_core import to_jsonable_python
from rich.console import Console

from nlsolve.cli.endings import ExitCode, ending
from nlsolve.cli.examples import examples
from nlsolve.cli.folders import folders
from nlsolve.cli.options import (
    Disabled,
    Failed,
    Jobs,
    Json,
    Only,
    Out,
    PluginFiles,
    Quick,
    Retry,
    Settings,
    Shard,
    Skip,
    StudyFile,
    checked_study,
    default_folder,
    registry_of,
)
from nlsolve.cli.plugins.check import check
from nlsolve.cli.plugins.listing import plugins
from nlsolve.cli.plugins.new import new
from nlsolve.cli.printing import (
    count,
    left_out,
    print_frame,
    print_results,
    say,
    say_endings,
    say_excluded,
)
from nlsolve.cli.progress import Watch
from nlsolve.contracts.status import Status
from nlsolve.registry.problems import StudyError, did_you_mean
from nlsolve.results.aggregates import shared_ways
from nlsolve.results.frames import json_rows
from nlsolve.running.diagnose import diagnose as diagnostics_of
from nlsolve.running.planning.plan import plan_of
from nlsolve.running.runner import run as run_study
from nlsolve.study.keys.schema import study_schema

app = typer.Typer(
    help="Compare nonlinear solution strategies on equal terms.", no_args_is_help=True, pretty_exceptions_enable=False
)


@app.callback()
def common(
    _version: Annotated[
        bool,
        typer.Option(
            "--version", is_eager=True, callback=lambda asked: show_version(asked), help="print the version and exit"
        ),
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
    out: Out = None,
    settings: Settings = None,
    quick: Quick = False,
    plugin: PluginFiles = None,
    disable_plugin: Disabled = None,
    as_json: Json = False,
    jobs: Jobs = None,
    isolation: Annotated[
        str | None,
        typer.Option(metavar="HOW", help="process: each case in a worker process, the default; none: all in this one"),
    ] = None,
    pdb: Annotated[bool, typer.Option("--pdb", help="debug an error where it is raised; no isolation")] = False,
    engine: Annotated[
        str | None, typer.Option(metavar="NAME", help="local: on this machine, the default; dask: on a cluster")
    ] = None,
    scheduler: Annotated[
        str | None, typer.Option(metavar="ADDRESS", help="scheduler of the cluster; default: one of this machine")
    ] = None,
    retry: Retry = None,
    only: Only = None,
    skip: Skip = None,
    failed: Failed = False,
    shard: Shard = None,
) -> None:
    """Run a study, or the part of it that is not yet in the results folder."""
    folder = out or default_folder(study, quick)
    console = Console(stderr=True)
    with ending(folder):
        checked = checked_study(study, settings, quick, plugin, disable_plugin)
        with Watch(console) as watch:
            results = run_study(
                checked,
                folder,
                listen=watch,
                isolation=isolation,
                jobs=jobs,
                retry=statuses(retry or []),
                debugger=watch.debug if pdb else None,
                engine=engine,
                scheduler=scheduler,
                only=only or [],
                skip=skip or [],
                failed=failed,
                shard=shard,
            )
    print_results(results, as_json)
    say_excluded(checked)
    for line in filter(None, (*left_out(results.runs), shared_ways(results.runs), *results.notes)):
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
    quick: Quick = False,
    plugin: PluginFiles = None,
    disable_plugin: Disabled = None,
    as_json: Json = False,
) -> None:
    """Check a study, and its quick form if it has one, without running it; with --quick, that form alone."""
    with ending():
        checked = checked_study(study, settings, quick, plugin, disable_plugin)
        both = not quick and checked.has_quick
        shrunk = checked_study(study, settings, True, plugin, disable_plugin, False) if both else None
    found = {"study": checked.name, "question": checked.question, "cases": len(checked.cases)}
    found |= {"quick_cases": len(shrunk.cases)} if shrunk else {}
    found |= {"excluded": [asdict(excluded) for excluded in checked.excluded]} if checked.excluded else {}
    if as_json:
        typer.echo(json.dumps(found))
    else:
        extra = f" ({len(shrunk.cases)} with --quick)" if shrunk else ""
        say_excluded(checked)
        typer.echo(f"{study} is valid: {count(len(checked.cases))}{extra}. {checked.question}")


@app.command()
def plan(
    study: StudyFile,
    out: Out = None,
    settings: Settings = None,
    quick: Quick = False,
    plugin: PluginFiles = None,
    disable_plugin: Disabled = None,
    as_json: Json = False,
    jobs: Jobs = None,
    retry: Retry = None,
    only: Only = None,
    skip: Skip = None,
    failed: Failed = False,
    shard: Shard = None,
) -> None:
    """List the cases of a study, which of them `run` would compute and why, and forecast how long that takes."""
    folder = out or default_folder(study, quick)
    with ending():
        checked = checked_study(study, settings, quick, plugin, disable_plugin)
        planned = plan_of(checked, folder, statuses(retry or []), only or [], skip or [], failed, shard, jobs)
    frame = planned.cases
    if as_json:
        told = {
            "assumption": planned.basis,
            "seconds": planned.seconds,
            "seconds_least": planned.seconds_least,
            "seconds_most": planned.seconds_most,
            "jobs": planned.jobs,
            "folder": str(folder),
        }
        typer.echo(json.dumps({**to_jsonable_python(told), "cases": json_rows(frame)}))
        return
    swept = list(dict.fromkeys(name for case in checked.cases for name in case.swept))
    sizes = ["increments", "nodes", "unknowns", "seconds_factorization", "seconds_start", "seconds", "seconds_expected"]
    say_excluded(checked)
    print_frame(count(len(frame)), frame[["case", "plan", *swept, *sizes]])
    words = ", ".join(f"{number} {word}" for word, number in frame["plan"].value_counts().items()) or "none chosen"
    typer.echo(f"{words} (results in {folder})")
    if checked.timing.is_exclusive:
        how_long = f"{planned.seconds:.3g} to {planned.seconds_most:.3g} s to time {count(len(planned.left))} in rounds"
    else:
        side_by_side = f", {planned.jobs} at a time" if planned.jobs > 1 else ""
        is_known = planned.seconds_most > planned.seconds
        between = f" ({planned.seconds_least:.3g} to {planned.seconds_most:.3g} s)" if is_known else ""
        how_long = f"{planned.seconds:.3g} s{between} to run {count(len(planned.left))}{side_by_side}"
    typer.echo(f"{how_long} ({planned.basis})")


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
        frame = diagnostics_of(checked_study(study, settings, quick, plugin, disable_plugin))
    if as_json:
        typer.echo(json.dumps(json_rows(frame)))
    else:
        print_frame("Operators, one row each", frame)


@app.command()
def schema(plugin: PluginFiles = None, disable_plugin: Disabled = None) -> None:
    """Print the JSON schema of study files, composed from the installed plugins."""
    with ending():
        registry = registry_of(plugin, disable_plugin)
    typer.echo(json.dumps(study_schema(registry), indent=1, ensure_ascii=False))


def statuses(words: list[str]) -> list[Status]:
    """The statuses of --retry. Raises StudyError for a word that is none."""
    known = [status.word for status in Status]
    for word in words:
        if word not in known:
            raise StudyError(f"--retry {word!r}: no such status; {did_you_mean(word, known)}")
    return [Status.of(word) for word in words]


app.command()(examples)
app.command()(plugins)
app.command()(check)
app.command()(new)
app.add_typer(folders)
