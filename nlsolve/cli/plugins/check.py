"""`nlsolve check KIND_OR_FILE`: the conformance kit from the shell."""

from __future__ import annotations

import json
from dataclasses import asdict
from typing import Annotated

import typer
from rich.markup import escape
from rich.table import Table

from nlsolve.cli.endings import ExitCode, ending
from nlsolve.cli.options import Disabled, Json, PluginFiles, registry_of
from nlsolve.cli.plugins.apart import checked_apart
from nlsolve.cli.plugins.checking import Checked
from nlsolve.cli.printing import say, stdout


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
        found = [one for subject in subjects for one in checked_apart(subject, registry, plugin or [], settings or [])]
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
