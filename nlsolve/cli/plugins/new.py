"""`nlsolve new CONTRACT NAME`: the files of a plugin of your own, which pass and run as they are written."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from nlsolve.cli.endings import ending
from nlsolve.cli.plugins.scaffold import CONTRACTS, files_of, write
from nlsolve.registry.problems import StudyError, did_you_mean


def contracts(incomplete: str) -> list[str]:
    """What a shell may complete."""
    return [contract for contract in CONTRACTS if contract.startswith(incomplete)]


def new(
    contract: Annotated[str, typer.Argument(metavar="CONTRACT", help=", ".join(CONTRACTS), autocompletion=contracts)],
    name: Annotated[
        str, typer.Argument(metavar="NAME", help="the kind by which studies ask for it, such as my-solver")
    ],
    package: Annotated[
        bool, typer.Option("--package", help="a package with pyproject.toml, entry point and CI")
    ] = False,
    folder: Annotated[Path, typer.Option("--to", metavar="DIR", help="where the files go")] = Path(),
) -> None:
    """Write a plugin of one file, its test, and a study that uses it. No file is ever overwritten."""
    with ending():
        if contract not in CONTRACTS:
            raise StudyError(f"{contract}: no such contract; {did_you_mean(contract, list(CONTRACTS))}")
        paths = write(files_of(contract, name, package), folder)
    for path in paths:
        typer.echo(str(path))
    study = next(path for path in paths if path.suffix == ".toml" and path.name != "pyproject.toml")
    plugin = next(path for path in paths if path.suffix == ".py")
    test = next(path for path in paths if path.name.startswith("test_"))
    typer.echo("")
    if package:
        typer.echo(f"pip install -e '{plugin.parent}[test]'")
    typer.echo(f"nlsolve check {name if package else plugin}")
    typer.echo(f"nlsolve run {study}")
    typer.echo(f"pytest {test}")
