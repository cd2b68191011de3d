"""`nlsolve plugins [SECTION] [KIND]`: what is installed, on one page; one section or kind of it in detail."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict
from typing import Annotated, Any

import typer
from pydantic_core import to_jsonable_python
from rich.markup import escape
from rich.table import Table

from nlsolve.cli.endings import ending
from nlsolve.cli.options import Disabled, Json, PluginFiles, registry_of
from nlsolve.cli.printing import folded, stdout
from nlsolve.registry.classes import CONTRACTS, QUALIFIED
from nlsolve.registry.installed.contract_version import CONTRACT_VERSION
from nlsolve.registry.offers import FIRST_PARTY
from nlsolve.registry.problems import StudyError, did_you_mean
from nlsolve.registry.rows import PluginRow
from nlsolve.study.case import section_rows

WITH_KINDS = "Sections of a study, and the kinds that are installed; `nlsolve plugins solver newton` tells of one:"
WITHOUT_KINDS = "Sections without kinds; `nlsolve plugins stop` tells the keys of one:"


def plugins(
    words: Annotated[
        list[str] | None,
        typer.Argument(metavar="SECTION_OR_KIND", help="a section, a kind, or both: what is told in detail"),
    ] = None,
    plugin: PluginFiles = None,
    disable_plugin: Disabled = None,
    as_json: Json = False,
) -> None:
    """List the sections of a study and the kinds installed for them, and what failed; or tell of one in detail."""
    with ending():
        registry = registry_of(plugin, disable_plugin)
        rows = [*section_rows(registry), *registry.plugins()]
        asked = _asked(rows, words or [])
    if as_json:
        typer.echo(json.dumps(to_jsonable_python([asdict(row) for row in asked])))
    elif words:
        for row in asked:
            _print_row(row)
    else:
        typer.echo("\n".join(_page(rows)))


def _asked(rows: Sequence[PluginRow], words: Sequence[str]) -> list[PluginRow]:
    """The rows that one or two words mean: a section, a kind of any section, or a section and a kind of it.

    Raises StudyError for words that mean nothing.
    """
    found = list(rows)
    for word in words:
        known = list(dict.fromkeys(name for row in found for name in _names(row)))
        found = [row for row in found if word in _names(row)]
        if not found:
            raise StudyError(f"{' '.join(words)}: no such section or kind; {did_you_mean(word, known)}")
    return found


def _names(row: PluginRow) -> list[str]:
    """The words that ask for a row."""
    return [name for name in dict.fromkeys((row.noun, row.kind, row.kind.rpartition(QUALIFIED)[2])) if name]


def _page(rows: Sequence[PluginRow]) -> Iterator[str]:
    """The lines of the page: kinds by section, sections without kinds, what cannot be used here, and why."""
    usable = [row for row in rows if row.failure is None]
    width = max(map(len, CONTRACTS)) + 2
    yield WITH_KINDS
    for noun in CONTRACTS:
        name = noun
        for source, kinds in _by_source([row for row in usable if row.noun == noun]).items():
            from_whom = "" if source.partition(" ")[0] == FIRST_PARTY else f"from {source}: "
            yield from folded(f"  {name:<{width}}", from_whom + ", ".join(kinds))
            name = ""
    yield ""
    yield WITHOUT_KINDS
    yield from folded("  ", ", ".join(row.noun for row in usable if not row.kind))
    yield ""
    yield f"Version {CONTRACT_VERSION} of the plugin contract."
    failed = [row for row in rows if row.failure is not None]
    if failed:
        yield ""
        yield "What cannot be used here:"
    for row in failed:  # the reason of a kind begins with it
        yield from folded("  ", str(row.failure) if row.kind else f"{row.source}: {row.failure}")


def _by_source(rows: Sequence[PluginRow]) -> Mapping[str, list[str]]:
    """Package, or file, -> kinds; modules of one package are one source."""
    found: dict[str, list[str]] = {}
    for row in rows:
        own = row.source.partition(" ")[0] == FIRST_PARTY
        found.setdefault(FIRST_PARTY if own else row.source, []).append(row.kind)
    return found


def _print_row(row: PluginRow) -> None:
    """Print what a kind is, where it comes from, and a table of its parameters."""
    typer.echo(" ".join(filter(None, (row.noun, row.kind))) or row.source)
    for text in (row.meaning, f"from {row.source}", row.failure):
        if text:
            typer.echo("\n".join(folded("  ", text)))
    if row.parameters:
        table = Table(box=None, padding=(0, 2, 0, 2))
        for heading in ("parameter", "default", "type", "meaning"):
            table.add_column(heading, overflow="fold")
        for each in row.parameters:
            table.add_row(*map(escape, (each.name, _value(each.default), each.type, each.description)))
        stdout().print(table)
    typer.echo("")


def _value(default: Any) -> str:
    """A default as a study would write it, or nearly so."""
    if default is None:
        return "absent"
    return str(default).lower() if isinstance(default, bool) else str(default)
