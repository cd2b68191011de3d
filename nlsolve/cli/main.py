"""The console's entry point: the version at once, everything else when it is asked for."""

from __future__ import annotations

import sys
from importlib import import_module
from importlib.metadata import version


def main() -> None:
    """`nlsolve …`; `nlsolve --version` loads no library."""
    if sys.argv[1:] == ["--version"]:
        print(f"nlsolve {version('nlsolve')}")
    else:
        import_module("nlsolve.cli.app").app()
