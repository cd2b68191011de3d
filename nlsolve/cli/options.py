"""Arguments and options that several commands have."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

StudyFile = Annotated[Path, typer.Argument(metavar="STUDY", help="a study file (TOML)")]
Settings = Annotated[
    list[str] | None, typer.Option("--set", metavar="KEY=VALUE", help="set a parameter, such as solver.order=20")
]
Quick = Annotated[bool, typer.Option("--quick", help="the shrunk study of the file's [quick] section")]
Out = Annotated[Path | None, typer.Option(help="results folder; default: results/NAME or results/NAME-quick")]
Json = Annotated[bool, typer.Option("--json", help="machine-readable output")]


def default_folder(study: Path, quick: bool) -> Path:
    """The results folder of a study where none is named."""
    return Path("results") / (study.stem + ("-quick" if quick else ""))
