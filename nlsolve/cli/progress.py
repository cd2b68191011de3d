"""The progress of a run on standard error: a bar on a terminal, plain lines anywhere else."""

from __future__ import annotations

import pdb
import time
from types import TracebackType
from typing import Self

from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn

from nlsolve.running.runner import Event

SECONDS_BETWEEN_LINES = 10.0
"""A line is printed at the end of every case, and this often between."""


class Watch:
    """A listener of a run that shows its progress. A context: the bar is taken down at its end."""

    def __init__(self, console: Console) -> None:
        self.console = console
        self.factorizations = 0
        self.read_back = self.ended = 0
        self.running: dict[int, float] = {}
        self.begun = self.told = time.monotonic()
        columns = (BarColumn(8), TextColumn("{task.description}", markup=False))
        self.bar = Progress(*columns, console=console, disable=not console.is_terminal)
        self.task = self.bar.add_task("starting", total=None)

    def __enter__(self) -> Self:
        self.bar.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.bar.stop()

    def __call__(self, event: Event) -> None:
        """Show an event; cases may run side by side."""
        now = event.progress
        if event.run is None:
            self.running[event.number] = now.increment / now.increments if now is not None else 0.0
        else:
            self.running.pop(event.number, None)
            self.ended += 1
        if event.resumed:
            self.read_back += 1
            if self.read_back == self.ended:
                self.begun = time.monotonic()
        elif event.run is not None:
            self.factorizations += int(event.run.get("factorizations", 0))
        done = self.ended + sum(self.running.values())
        words = self.words(event, done)
        self.bar.update(self.task, description=words, total=event.cases, completed=done)
        due = event.run is not None or time.monotonic() - self.told > SECONDS_BETWEEN_LINES
        if due and not self.console.is_terminal:
            self.told = time.monotonic()
            print(words, file=self.console.file, flush=True)

    def debug(self, error: BaseException) -> None:
        """Take the bar down and debug an error where it was raised."""
        self.bar.stop()
        self.console.print(f"{type(error).__name__}: {error}", markup=False, highlight=False)
        pdb.post_mortem(error.__traceback__)
        self.bar.start()

    def words(self, event: Event, done: float) -> str:
        """case 3/16, increment 12/1250, tangent 3, 17 factorisations, 140 s left (solver.order = 20)

        The label comes last: a narrow terminal cuts it off, not the numbers.
        """
        words = [f"case {event.number}/{event.cases}"]
        if event.run is not None:
            words.append(f"{event.run['status']}{' before' if event.resumed else ''}")
        now = event.progress
        if now is not None:
            words.append(f"increment {now.increment}/{now.increments}, tangent {now.tangents}")
        words.append(f"{self.factorizations + (now.factorizations if now else 0)} factorisations")
        computed = done - self.read_back
        if computed > 0 and done < event.cases:
            words.append(f"{(time.monotonic() - self.begun) * (event.cases - done) / computed:.0f} s left")
        return f"{', '.join(words)} ({event.case.label})"
