"""A worker process as its runner sees it: tasks, answers, output, memory, and how it is stopped."""

from __future__ import annotations

import json
import multiprocessing
import os
import signal
import subprocess
import sys
import tempfile
import time
from contextlib import suppress
from multiprocessing.connection import wait
from typing import Any

import psutil

from nlsolve.registry.installed.probing import environment_of_faults

BOOT = (
    "import json, sys; argument = json.loads(sys.argv.pop()); sys.path[:] = argument['path']; "
    "from nlsolve.running.engines.processes.worker import main; main(*argument['main'])"
)
"""The worker's program. Its modules are found where the runner finds its own."""

ONE_THREAD = dict.fromkeys(
    (
        "OPENBLAS_NUM_THREADS",
        "OMP_NUM_THREADS",
        "MKL_NUM_THREADS",
        "BLIS_NUM_THREADS",
        "VECLIB_MAXIMUM_THREADS",
        "NUMEXPR_NUM_THREADS",
    ),
    "1",
)
"""Read by the libraries of linear algebra when they are loaded."""

END_OF_OUTPUT = 500_000
"""Bytes of a case's output that are kept of its beginning, and as many of its end."""

CHUNKS, CHUNK = 64, 2**16
"""How much of the output is read at a time: so many pieces of so many bytes."""

SECONDS_BETWEEN_FAMILIES = 1.0
"""How often the descendants of a process are looked for, for which all processes of the machine are read [s]."""

_now = time.monotonic


class WorkerProcess:
    """A worker process and all processes that descend from it.

    folder : the folder in which it works; absent: that of this process.
    core : the core that it is kept on; absent: whichever there is.
    gone : whether it will not answer any more.
    begun : when it was started, by the monotonic clock [s].
    """

    def __init__(self, folder: str | None = None, core: int | None = None) -> None:
        self.connection, theirs = multiprocessing.Pipe()
        self._faults = tempfile.TemporaryFile(buffering=0)  # noqa: SIM115  # closed by `kill`
        self._output, written = os.pipe()
        os.set_blocking(self._output, False)
        argument = {"path": sys.path, "main": [theirs.fileno(), self._faults.fileno(), os.getpid(), core]}
        self.begun = _now()
        self._popen = subprocess.Popen(
            [sys.executable, "-P", "-c", BOOT, json.dumps(argument)],
            cwd=folder,
            stdin=subprocess.DEVNULL,
            stdout=written,
            stderr=written,
            env={**os.environ, **ONE_THREAD, **environment_of_faults()},
            pass_fds=(theirs.fileno(), self._faults.fileno()),
            start_new_session=True,
        )
        theirs.close()
        os.close(written)
        self._process = psutil.Process(self._popen.pid)
        self.gone = False
        self._first, self._last, self._left_out = bytearray(), bytearray(), 0
        self._noted = 0
        self._code: int | None = None
        self._family: list[psutil.Process] = []
        self._looked = self.begun

    def begin(self) -> None:
        """Forget the output and the faults there have been: a case begins."""
        self._drain()
        self._first, self._last, self._left_out = bytearray(), bytearray(), 0
        self._noted = os.fstat(self._faults.fileno()).st_size

    def send(self, message: Any) -> None:
        """Send a task."""
        with suppress(OSError):  # it is gone, which the next answer tells
            self.connection.send(message)

    def answer(self, seconds: float) -> Any:
        """The next message, or None when none has come within `seconds` or the process is gone."""
        if self._output in wait([self.connection, self._output], seconds):
            self._drain()
        try:
            if self.connection.poll():
                return self.connection.recv()
            self.gone = self._popen.poll() is not None and not self.connection.poll()
        except (EOFError, OSError):
            self.gone = True
        return None

    def resident(self) -> int:
        """Resident memory of the process and of its descendants, which are looked for now and then [bytes]."""
        if _now() - self._looked > SECONDS_BETWEEN_FAMILIES:
            self._family, self._looked = self.descendants(), _now()
        found = 0
        for process in (self._process, *self._family):
            with suppress(psutil.Error):
                found += process.memory_info().rss
        return found

    def descendants(self) -> list[psutil.Process]:
        """All processes that descend from this one, orphans too where the kernel can give them back (Linux)."""
        with suppress(psutil.Error):
            return self._process.children(recursive=True)
        return []

    def signal(self, number: int) -> None:
        """Send a signal to the process alone."""
        with suppress(ProcessLookupError):
            if self._popen.poll() is None:
                os.kill(self._popen.pid, number)

    def kill(self) -> int:
        """Kill the process, its session and its descendants. Returns its exit code, minus the signal for a signal."""
        if self._code is not None:
            return self._code
        family = self.descendants()
        with suppress(ProcessLookupError, PermissionError):
            os.killpg(self._popen.pid, signal.SIGKILL)
        for process in family:
            with suppress(psutil.Error):
                process.kill()
        self._code = self._popen.wait()
        self.gone = True
        self._drain()
        self.connection.close()
        return self._code

    def exit_code(self, seconds: float) -> int | None:
        """How the process has ended within `seconds`; None when it is still there."""
        try:
            return self._popen.wait(seconds)
        except subprocess.TimeoutExpired:
            return None

    def close(self) -> None:
        """Give the descriptors back."""
        self._faults.close()
        os.close(self._output)

    @property
    def faults(self) -> str:
        """What `faulthandler` has written of the case."""
        size = os.fstat(self._faults.fileno()).st_size
        return os.pread(self._faults.fileno(), size - self._noted, self._noted).decode(errors="replace")

    @property
    def output(self) -> str:
        """What the case has printed, without the middle of a flood."""
        self._drain()
        left_out = f"\n… {self._left_out} bytes left out …\n".encode() if self._left_out else b""
        return bytes(self._first + left_out + self._last).decode(errors="replace")

    def _drain(self) -> None:
        """Read what there is of the output, at most some chunks of a flood."""
        for _ in range(CHUNKS):
            try:
                data = os.read(self._output, CHUNK)
            except OSError:  # nothing there now
                return
            if not data:
                return
            room = END_OF_OUTPUT - len(self._first)
            self._first += data[:room]
            self._last += data[max(room, 0) :]
            over = len(self._last) - END_OF_OUTPUT
            if over > 0:
                self._left_out += over
                del self._last[:over]
