"""Arguments and options that several commands have."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from nlsolve.cli.disabling import disable
from nlsolve.cli.printing import say
from nlsolve.registry.plugin_files import with_files
from nlsolve.registry.registry import Registry, load_registry
from nlsolve.study.study import Study
from nlsolve.study.sweeps import parse_assignments

StudyFile = Annotated[Path, typer.Argument(metavar="STUDY", help="a study file (TOML)")]
Settings = Annotated[
    list[str] | None, typer.Option("--set", metavar="KEY=VALUE", help="set a parameter, such as solver.order=20")
]
Quick = Annotated[bool, typer.Option("--quick", help=r"the shrunk study of the file's \[quick] section")]
Out = Annotated[Path | None, typer.Option(help="results folder; default: results/NAME or results/NAME-quick")]
PluginFiles = Annotated[
    list[Path] | None,
    typer.Option("--plugin", metavar="FILE", help="a plugin of one file, beside those that the study names"),
]
Disabled = Annotated[
    list[str] | None,
    typer.Option("--disable-plugin", metavar="NAME", help="a plugin, or a package of plugins, that is not imported"),
]
Retry = Annotated[
    list[str] | None, typer.Option("--retry", metavar="STATUS", help="run finished cases of this status again")
]
Only = Annotated[
    list[str] | None,
    typer.Option(
        "--only", metavar="EXPR", help="run only cases with solver.kind=anm (or a pattern), a status, or a case's id"
    ),
]
Skip = Annotated[
    list[str] | None, typer.Option("--skip", metavar="EXPR", help="leave out the cases that fit, written as for --only")
]
Failed = Annotated[bool, typer.Option("--failed", help="run again only what crashed or was stopped at a limit")]
Shard = Annotated[
    str | None,
    typer.Option("--shard", metavar="I/N", help="run every N-th case from the I-th on, for batch arrays"),
]
Jobs = Annotated[
    int | None,
    typer.Option(
        "--jobs", help="cases at a time; default: the physical cores, but 1 for a study that says how it is timed"
    ),
]
Json = Annotated[bool, typer.Option("--json", help="machine-readable output")]


def default_folder(study: Path, quick: bool) -> Path:
    """The results folder of a study where none is named."""
    return Path("results") / (study.stem + ("-quick" if quick else ""))


def registry_of(files: list[Path] | None, disabled: list[str] | None) -> Registry:
    """The installed plugins but those disabled, and those of files. Raises StudyError for one that cannot be used."""
    disable(disabled or [])
    return with_files(load_registry(), files or [])


def checked_study(
    path: Path,
    settings: list[str] | None,
    quick: bool,
    files: list[Path] | None,
    disabled: list[str] | None,
    tell: bool = True,
) -> Study:
    """The study of a file with these settings and plugins. Raises StudyError for one that is not valid.

    tell : whether a line on standard error tells of each plugin that failed: to try one may take its time.
    """
    registry = registry_of(files, disabled)
    for row in registry.failures if tell else ():
        say(f"{row.failure}; --disable-plugin {row.source.partition(' ')[0]} spares the attempt")
    return Study.from_toml(path, parse_assignments(settings or []), quick, registry)
