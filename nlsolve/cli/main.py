"""The entry point of the command line, which loads the commands only when one is called."""

from __future__ import annotations

import sys
from importlib import import_module
from importlib.metadata import version


def main() -> None:
    """Run `nlsolve …`; `nlsolve --version` loads no library."""
    if sys.argv[1:] == ["--version"]:
        print(f"nlsolve {version('nlsolve')}")
    else:
        import_module("nlsolve.cli.app").app()
