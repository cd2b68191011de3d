"""Plugins are checked in a process of their own: one that ends it, or cannot be stopped, has broken a promise."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator, Sequence
from contextlib import suppress
from multiprocessing import Pipe
from pathlib import Path
from typing import Any

from nlsolve.cli.plugins.checking import FILE, Checked, broken, checked
from nlsolve.registry.installed.probing import IMPORT_SECONDS, environment_of_faults, how_it_ended
from nlsolve.registry.problems import StudyError
from nlsolve.registry.registry import Registry
from nlsolve.testing.kit.verdicts import SECONDS

PROGRAM = (
    "import json, sys; argument = json.loads(sys.argv.pop()); sys.path[:] = argument.pop('path'); "
    "from nlsolve.cli.plugins.checking import tell; tell(**argument)"
)

GRACE = 5.0
"""Time beyond that of the checks of a component in which they must have stopped by themselves [s]."""

START_SECONDS = 120.0
"""Time in which the process must have started [s]."""

LOOK = 0.1
"""Time between looks at whether the process is there [s]."""


def checked_apart(
    subject: str, registry: Registry, files: Sequence[Path], settings: Sequence[str]
) -> Iterator[Checked]:
    """As `checked`; registry : that with the plugins of `files`."""
    if os.name != "posix":
        yield from checked(subject, registry, settings)
        return
    done, again = 0, True
    while again:
        again = False
        for found, ended in _of_process(subject, files, settings, done):
            yield found
            done += 1
            again = ended and found.noun != FILE  # what is behind it is checked by another process


def _of_process(
    subject: str, files: Sequence[Path], settings: Sequence[str], skip: int
) -> Iterator[tuple[Checked, bool]]:
    """What another process finds; of the last component whether it has ended the process.

    Raises StudyError for what that process was told wrongly, and where it ends without having begun.
    """
    connection, theirs = Pipe(duplex=False)
    argument = {
        "path": sys.path,
        "descriptor": theirs.fileno(),
        "subject": subject,
        "files": [str(file) for file in files],
        "settings": settings,
        "skip": skip,
    }
    process = subprocess.Popen(
        [sys.executable, "-P", "-c", PROGRAM, json.dumps(argument)],
        stdin=subprocess.DEVNULL,
        stdout=2,  # standard output has what is found, and nothing that a plugin prints
        env={**os.environ, **environment_of_faults()},
        pass_fds=(theirs.fileno(),),
        start_new_session=True,
    )
    theirs.close()
    so_far, running = None, ""
    deadline = time.monotonic() + START_SECONDS
    try:
        while True:
            message = _message(connection, process, deadline)
            if message is None:
                break
            if "end" in message:
                return
            if "wrong" in message:
                raise StudyError(message["wrong"])
            if "checked" in message:
                yield Checked.of(message["checked"]), False
                so_far = None
                continue
            at, running = Checked.of(message["at"]), message["name"]
            if so_far is None or (at.noun, at.kind) != (so_far.noun, so_far.kind):
                deadline = time.monotonic() + (IMPORT_SECONDS if at.noun == FILE else SECONDS + GRACE)
            so_far = at
        code = process.poll()
        how = "could not be stopped" if code is None else f"ended the interpreter with {how_it_ended(code)}"
        if so_far is None:
            raise StudyError(f"{subject}: cannot be checked: it {how}")
        yield broken(so_far, running, f'the check "{running}" {how}'), True
    finally:
        with suppress(ProcessLookupError, PermissionError):
            os.killpg(process.pid, signal.SIGKILL)
        process.wait()
        connection.close()


def _message(connection: Any, process: subprocess.Popen[bytes], deadline: float) -> dict[str, Any] | None:
    """The next message; None where the process has ended without one, or the deadline has passed."""
    while time.monotonic() < deadline:
        ended = process.poll() is not None  # asked first: what it has sent before is read still
        try:
            if connection.poll(0.0 if ended else LOOK):
                message: dict[str, Any] = json.loads(connection.recv_bytes())
                return message
        except (EOFError, OSError):
            with suppress(subprocess.TimeoutExpired):
                process.wait(1.0)
            return None
        if ended:
            return None
    return None
