"""The entry point of the command line, which loads the commands only when one is called."""

from __future__ import annotations

import gc
import sys
from importlib import import_module
from importlib.metadata import version


def main() -> None:
    """Run `nlsolve …`; `nlsolve --version` loads no library."""
    if sys.argv[1:] == ["--version"]:
        print(f"nlsolve {version('nlsolve')}")
        return
    gc.disable()  # what the libraries make as they are loaded is kept: to look for garbage in it takes 0.2 s
    commands = import_module("nlsolve.cli.app").app
    gc.freeze()
    gc.enable()
    commands()
