"""How the commands end: a sentence on standard error, and an exit code."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from enum import IntEnum
from pathlib import Path

import typer

from nlsolve.cli.printing import say
from nlsolve.contracts.status import InputError


class ExitCode(IntEnum):
    """The exit codes of the commands."""

    COMPLETE = 0
    CRASHED = 1
    BROKEN = 1  # a plugin does not keep its contract
    INVALID = 2
    NOT_FOUND = 3
    INTERRUPTED = 130


@contextmanager
def ending(folder: Path | None = None) -> Iterator[None]:
    """Turn invalid input and an interruption into a sentence on standard error and an exit code."""
    try:
        yield
    except InputError as error:
        say(str(error))
        raise typer.Exit(ExitCode.INVALID) from error
    except KeyboardInterrupt as error:
        kept = f"; the finished cases are in {folder} and the same command does the rest" if folder else ""
        say(f"interrupted{kept}")
        raise typer.Exit(ExitCode.INTERRUPTED) from error
