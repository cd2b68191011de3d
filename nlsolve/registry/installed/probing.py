"""Strangers' plugins are first imported in another process: one that exits, crashes, hangs or floods there is not
imported here, and becomes a row with the reason.
"""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, redirect_stdout, suppress
from functools import cache
from importlib import import_module
from importlib.metadata import EntryPoint
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path
from selectors import EVENT_READ, DefaultSelector
from types import ModuleType

IMPORT_SECONDS = 20.0
"""Time in which a plugin must be imported [s]."""

START_SECONDS = 120.0
"""Time in which the other process must have started [s]."""

LARGEST_OUTPUT = 100_000
"""Bytes that a plugin may print while it is imported."""

KNOWN_FAULTS = "NLSOLVE_PLUGIN_FAULTS"
"""Environment variable by which a process tells those it starts what it has found, as JSON."""

CHUNK = 2**16

PROGRAM = (
    "import json, sys; argument = json.loads(sys.argv.pop()); sys.path[:] = argument['path']; "
    "from nlsolve.registry.installed.probing import import_all; import_all(argument['entries'], argument['report'])"
)

FILE = "file"
"""Stands in place of the group of entry points for a plugin of one file: its name is a module's, its value a path."""

_found: dict[str, str] = {}
_now = time.monotonic
_exit = os._exit


def faults_of(entries: Sequence[EntryPoint]) -> Mapping[str, str]:
    """Entry point (`value`) -> why it must not be imported, for those that fail in a way that no `except` catches.

    They are tried once a process, or in the process that has started this one.
    """
    told = os.environ.get(KNOWN_FAULTS)
    if told is not None:
        known: dict[str, str] = json.loads(told)
        return known
    return _probed(tuple((entry.name, entry.value, entry.group) for entry in entries))


def fault_of_file(path: Path) -> str:
    """Why a plugin of one file must not be imported, as `faults_of`; empty where nothing speaks against it.

    It is not tried in a process that has been started for cases: the process that has started it has done so.
    """
    if os.environ.get(KNOWN_FAULTS) is not None or os.name != "posix":
        return ""
    done, reason = _imported([("nlsolve_file", str(path), FILE)])
    if not done:
        return reason
    return f"it raises {done[0]}" if done[0] else ""


def module_of_file(name: str, path: Path) -> ModuleType:
    """Import a file of Python as the module `name`. Raises whatever the file raises, and leaves no module then."""
    spec = spec_from_file_location(name, path)
    if spec is None or spec.loader is None:
        raise ImportError("it is no Python file")
    module = sys.modules[name] = module_from_spec(spec)
    try:
        spec.loader.exec_module(module)
    except BaseException:
        del sys.modules[name]
        raise
    return module


def environment_of_faults() -> dict[str, str]:
    """The environment variable that saves another process from trying again."""
    return {KNOWN_FAULTS: json.dumps(_found)}


@contextmanager
def undisturbed() -> Iterator[None]:
    """Whatever is imported meanwhile prints on standard error, and the working folder stays."""
    folder = os.path.realpath(os.curdir)
    with redirect_stdout(sys.stderr):
        try:
            yield
        finally:
            with suppress(OSError):  # it has been removed
                os.chdir(folder)


def import_all(entries: Sequence[Sequence[str]], report: int) -> None:
    """Import plugins, and write a line to the descriptor `report` before and after each; of the second process."""
    import_module("nlsolve.plugin")
    for number, (name, value, group) in enumerate(entries):
        os.write(report, f"{number}\n".encode())
        try:
            if group == FILE:
                module_of_file(name, Path(value))
            else:
                EntryPoint(name, value, group).load()
        except (SystemExit, KeyboardInterrupt) as error:
            os.write(report, f"{type(error).__name__}: {error}".rstrip(": ").encode() + b"\n")
        except Exception:  # is met again, and told, where the plugin is imported to be used
            os.write(report, b"\n")
        else:
            os.write(report, b"\n")
    _exit(0)


@cache
def _probed(entries: tuple[tuple[str, str, str], ...]) -> Mapping[str, str]:
    left = list(entries)
    while left:
        done, reason = _imported(left)
        _found.update({entry[1]: f"it raises {said}" for entry, said in zip(left, done, strict=False) if said})
        left = left[len(done) :]
        if not reason:  # nothing was imported there, which says nothing of what can be imported here
            break
        if left:
            _found[left.pop(0)[1]] = reason
    return _found


def _imported(entries: Sequence[tuple[str, str, str]]) -> tuple[list[str], str]:
    """What each import raised that was finished, and why the next was not; no reason where none was begun."""
    report, written = os.pipe()
    output, printed = os.pipe()
    argument = json.dumps({"path": sys.path, "entries": entries, "report": written})
    process = subprocess.Popen(
        [sys.executable, "-P", "-c", PROGRAM, argument],
        stdin=subprocess.DEVNULL,
        stdout=printed,
        stderr=printed,
        pass_fds=(written,),
        start_new_session=True,
    )
    os.close(written)
    os.close(printed)
    try:
        return _followed(process, report, output)
    finally:
        with suppress(ProcessLookupError, PermissionError):
            os.killpg(process.pid, signal.SIGKILL)
        process.wait()
        os.close(report)
        os.close(output)


def _followed(process: subprocess.Popen[bytes], report: int, output: int) -> tuple[list[str], str]:
    lines, printed, deadline = b"", 0, _now() + START_SECONDS
    with DefaultSelector() as selector:
        selector.register(report, EVENT_READ)
        selector.register(output, EVENT_READ)
        while True:
            ready = [key.fd for key, _ in selector.select(max(0.0, deadline - _now()))]
            if not ready:
                return _told(lines), f"it takes more than {IMPORT_SECONDS:g} s" if lines else ""
            if output in ready:
                data = os.read(output, CHUNK)
                printed += len(data)
                if not data:
                    selector.unregister(output)
                if printed > LARGEST_OUTPUT:
                    return _told(lines), f"it prints more than {LARGEST_OUTPUT} bytes"
            if report in ready:
                data = os.read(report, CHUNK)
                if not data:
                    break
                lines, printed, deadline = lines + data, 0, _now() + IMPORT_SECONDS
    return _told(lines), f"it ends the interpreter with {how_it_ended(process.wait())}" if lines else ""


def how_it_ended(code: int) -> str:
    """How a process ended: "exit code 3", or the name of the signal, whose number a code has below zero."""
    return signal.Signals(-code).name if code < 0 else f"exit code {code}"


def _told(lines: bytes) -> list[str]:
    """What each finished import raised: every second of the complete lines."""
    return lines.decode(errors="replace").split("\n")[:-1][1::2]
