"""The commands on results folders: table, figure, status, merge, gc, export."""

from __future__ import annotations

import json
from collections.abc import Sequence
from functools import cache
from pathlib import Path
from typing import Annotated

import typer
from pydantic import ValidationError

from nlsolve.cli.endings import ExitCode, ending
from nlsolve.cli.options import (
    Disabled,
    Json,
    Out,
    PluginFiles,
    Quick,
    Settings,
    StudyFile,
    checked_study,
    default_folder,
)
from nlsolve.cli.printing import count, print_endings, print_included, print_table, say
from nlsolve.registry.problems import StudyError, did_you_mean, problems_in
from nlsolve.results.parameters import differing_parameters
from nlsolve.running.packing.pack import export as packed
from nlsolve.running.runner import load, provenance_of
from nlsolve.running.store.reading import FolderStatus, read_tables, status_of_folder
from nlsolve.running.store.upkeep import merge_folders, remove, superfluous
from nlsolve.show.figures import FigureError, Look, content_of, drawn, write
from nlsolve.show.staleness import Included, Now, included
from nlsolve.show.tables import Table, built

folders = typer.Typer()

Folder = Annotated[Path, typer.Argument(metavar="DIR", help="a results folder")]


@folders.command()
def table(
    folder: Folder,
    name: Annotated[str | None, typer.Argument(metavar="NAME", help="one declared table; default: all")] = None,
    as_json: Json = False,
    check: Annotated[
        Path | None,
        typer.Option(metavar="PAPER.tex", help="tell instead whether what a paper includes is stale"),
    ] = None,
) -> None:
    """Print the declared tables of a results folder, or the endings if there are none, of whatever is finished.

    With --check, tell of each table and figure that PAPER.tex includes whether it says what the results say now; exit
    code 3 when one does not.
    """
    with ending():
        described, runs = read_tables(folder)
        names = [spec.name for spec in described.tables]
        if name is not None and name not in names:
            raise StudyError(f"{folder}: there is no table {name!r}; {did_you_mean(name, names)}")
        tables, refused = built([spec for spec in described.tables if name in (None, spec.name)], runs)
        if name is not None and refused:
            raise StudyError(*refused)
        if check is not None:
            found = included(check, described.name, _contents(folder, tables))
            found = [each for each in found if name is None or (each.noun, each.name) == ("table", name)]
    if len(runs) < len(described.cases):
        say(f"{folder}: {len(runs)} of {count(len(described.cases))} are finished")
    for sentence in refused:
        say(sentence)
    if check is not None:
        _tell(found, folder, as_json)
        return
    if as_json:
        typer.echo(json.dumps({table.spec.name: table.long() for table in tables}))
        return
    for declared in tables:
        print_table(declared)
    if not described.tables:
        shared = [name for name in differing_parameters(runs) if runs[name].notna().all()]
        print_endings(described.question, runs, shared)


def _tell(found: Sequence[Included], folder: Path, as_json: bool) -> None:
    """Print of what a paper includes whether it is stale. Raises typer.Exit where something is."""
    print_included(found, folder, as_json)
    if any(each.reason for each in found):
        raise typer.Exit(ExitCode.NOT_FOUND)


def _contents(folder: Path, tables: Sequence[Table]) -> Now:
    """What each table and figure of a results folder tells now, as a digest; a figure is drawn when it is asked for."""
    digests = {table.spec.name: table.grid().digest for table in tables}
    results = cache(load)

    def content(noun: str, name: str) -> str | None:
        if noun == "table":
            return digests.get(name)
        spec = next((spec for spec in results(folder).study.figures if spec.name == name), None)
        try:
            return None if spec is None else content_of(spec, drawn(spec, results(folder).frames)[1])
        except FigureError:
            return None

    return content


@folders.command()
def figure(
    folder: Folder,
    name: Annotated[str | None, typer.Argument(help="one declared figure; default: all")] = None,
    width: Annotated[
        str | None, typer.Option(help="width on paper: single, double, or a length such as 84mm, 3.3in or 240pt")
    ] = None,
    font: Annotated[str | None, typer.Option(help="serif, sans-serif, or an installed font")] = None,
    font_size: Annotated[float | None, typer.Option(help="size of titles and labels in points")] = None,
    formats: Annotated[
        list[str] | None, typer.Option("--format", help="png, pdf, svg or pgf; may be given several times")
    ] = None,
    resolution: Annotated[int | None, typer.Option(help="dots per inch of PNG")] = None,
    to: Annotated[Path | None, typer.Option(metavar="FOLDER", help="where to; default: figures in DIR")] = None,
    as_json: Annotated[bool, typer.Option("--json", help="machine-readable output of --check")] = False,
    check: Annotated[
        Path | None,
        typer.Option(metavar="PAPER.tex", help="tell instead whether the figures that a paper includes are stale"),
    ] = None,
) -> None:
    """Draw the declared figures of a results folder again, of whatever is finished, perhaps wider or in other formats.

    Nothing is run. What no option says is as the study says. With --check, nothing is drawn: it is told of each figure
    that PAPER.tex includes whether it shows what the results say now; exit code 3 when one does not.
    """
    given = {"width": width, "font": font, "font_size": font_size, "formats": formats, "resolution": resolution}
    with ending():
        look = _look({key: value for key, value in given.items() if value is not None})
        results = load(folder)
        names = [spec.name for spec in results.study.figures]
        if name is not None and name not in names:
            raise StudyError(f"{folder}: there is no figure {name!r}; {did_you_mean(name, names)}")
        if check is not None:
            found = included(check, results.study.name, _contents(folder, ()))
            wanted = [each for each in found if each.noun == "figure" and name in (None, each.name)]
            _tell(wanted, folder, as_json)
            return
        told = [*results.notes, *([] if names else [f"{folder}: its study declares no figures"])]
        for spec in results.study.figures:
            if name in (None, spec.name):
                try:
                    made = provenance_of(results.study, folder)
                    written = write(spec.with_(**look.said), results.frames, to or folder / "figures", made)
                except FigureError as error:
                    if name is not None:
                        raise StudyError(str(error)) from error
                    told.append(str(error))
                    continue
                told += written.notes
                for path in written.paths:
                    typer.echo(str(path))
    for sentence in told:
        say(sentence)


def _look(given: dict[str, object]) -> Look:
    """A look by the options of a command. Raises StudyError for a value that it cannot have."""
    try:
        return Look.model_validate(given)
    except ValidationError as error:
        wrong = problems_in(error, Look, given)
        options = {"formats": "format", "font_size": "font-size"}
        sentences = [
            f"--{options.get(str(problem.place[0]), problem.place[0])} {problem.value}: {problem.expected}"
            for problem in wrong
        ]
        raise StudyError(*sentences) from error


@folders.command()
def status(folder: Folder, as_json: Json = False) -> None:
    """Tell how far a results folder is: finished, running, failed and left. It works during a run and after a kill."""
    with ending():
        found = status_of_folder(folder)
    if as_json:
        typer.echo(json.dumps(_plain(folder, found)))
        return
    if found.study is None:
        typer.echo(f"{folder}: its study.json cannot be read, so what is left is not known")
    else:
        typer.echo(f"{folder}: {found.study.question}")
    words = ", ".join(f"{number} {word}" for word, number in found.endings.items())
    finished = sum(found.endings.values())
    if found.study is None:
        told, left = count(finished), ""
    else:
        told, left = f"{finished} of {count(found.planned)}", f", {found.left} left"
    typer.echo(f"{told} finished{f' ({words})' if words else ''}")
    typer.echo(f"{len(found.running)} running{left}")
    if found.others:
        typer.echo(f"{count(found.others)} more, of other studies, other settings or earlier sources")
    for case, message in found.failures.items():
        say(f"case {case} failed: {message}")


def _plain(folder: Path, found: FolderStatus) -> dict[str, object]:
    return {
        "folder": str(folder),
        "study": found.study.name if found.study else None,
        "question": found.study.question if found.study else None,
        "cases": found.planned,
        "finished": sum(found.endings.values()),
        "endings": dict(found.endings),
        "failures": dict(found.failures),
        "running": list(found.running),
        "left": found.left if found.study else None,
        "others": found.others,
    }


@folders.command()
def merge(
    source: Annotated[Path, typer.Argument(metavar="A", help="a results folder")],
    into: Annotated[Path, typer.Argument(metavar="B", help="the folder to copy to, which need not exist")],
) -> None:
    """Copy what is finished in the results folder A to the results folder B. A stays as it is."""
    with ending():
        done = merge_folders(source, into)
    told = f"{into}: {count(done.copied)} copied from {source}, {done.there} there already"
    typer.echo(f"{told}, {done.damaged} damaged and left out" if done.damaged else told)


@folders.command()
def gc(
    folder: Folder,
    others: Annotated[bool, typer.Option("--others", help="also remove the cases of other studies")] = False,
    dry_run: Annotated[bool, typer.Option("--dry-run", help="only say what would be removed")] = False,
) -> None:
    """Remove from a results folder what nothing needs: damaged and outdated cases, and what killed runs have left."""
    with ending():
        files = superfluous(folder, others)
        if dry_run:
            for path in files:
                typer.echo(str(path))
            return
        freed = remove(folder, files)
    typer.echo(f"{folder}: {len(files)} file{'' if len(files) == 1 else 's'} removed, {freed / 1e6:.3g} MB")


@folders.command()
def export(
    study: StudyFile,
    out: Out = None,
    settings: Settings = None,
    quick: Quick = False,
    plugin: PluginFiles = None,
    disable_plugin: Disabled = None,
    to: Annotated[Path | None, typer.Option(metavar="FILE", help="the zip; default: NAME.zip")] = None,
) -> None:
    """Pack a study, plugins of one file, files of nodes, versions and results into one zip that can be run again."""
    folder, target = out or default_folder(study, quick), to or Path(f"{study.stem}.zip")
    options = [word for setting in settings or [] for word in ("--set", setting)] + ["--quick"] * quick
    with ending():
        checked = checked_study(study, settings, quick, plugin, disable_plugin)
        missing = packed(checked, study, options, folder, target, plugin or [])
    for path in missing:
        say(f"{path} is not in the zip: the study must name it by a path within the folder it is run in")
    typer.echo(f"{target}: {target.stat().st_size / 1e6:.3g} MB")
