"""`nlsolve examples [NAME] [DIR]`: the studies that ship with nlsolve, and copies of them."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated

import typer

from nlsolve.cli.endings import ending
from nlsolve.cli.options import Json
from nlsolve.cli.plugins.scaffold import write
from nlsolve.cli.printing import folded
from nlsolve.running.packing.shipped import ALL, copied, shipped_studies


def names(incomplete: str) -> list[str]:
    """What a shell may complete."""
    known = [*(study.name for study in shipped_studies()), ALL]
    return [name for name in known if name.startswith(incomplete)]


def examples(
    name: Annotated[
        str | None,
        typer.Argument(metavar="NAME", help="the study to copy, or all; absent: list them", autocompletion=names),
    ] = None,
    folder: Annotated[Path, typer.Argument(metavar="DIR", help="where the copy goes")] = Path(),
    as_json: Json = False,
) -> None:
    """List the studies that ship with nlsolve and the question of each, or copy one of them. No file is overwritten."""
    with ending():
        studies = shipped_studies()
        paths = [] if name is None else write(copied(name), folder)
    if as_json:
        listed = [{"name": study.name, "question": study.question, "has_quick": study.has_quick} for study in studies]
        typer.echo(json.dumps([str(path) for path in paths] if paths else listed, ensure_ascii=False))
        return
    if name is None:
        width = max(len(study.name) for study in studies) + 2
        for study in studies:
            typer.echo("\n".join(folded(f"{study.name:<{width}}", study.question)))
        typer.echo("\n`nlsolve examples first` copies one of them, `nlsolve examples all DIR` all.")
        return
    for path in paths:
        typer.echo(str(path))
    quick = {study.file.name: study.has_quick for study in studies}
    if name != ALL:
        (study_file,) = [path for path in paths if path.name in quick][-1:]
        typer.echo(f"\nnlsolve run {study_file}{' --quick' if quick[study_file.name] else ''}")
