"""What a worker of dask does for a run: each of its threads has cases done by a worker process on its machine."""

from __future__ import annotations

import os
import pickle
import threading
from collections.abc import Mapping
from dataclasses import dataclass

from distributed import get_worker

from nlsolve.results.frames import Part
from nlsolve.running.engines.processes.keeper import Keeper
from nlsolve.running.engines.processes.travel import Task, Unreadable
from nlsolve.solving.simulate import Progress
from nlsolve.solving.way import Way


@dataclass(frozen=True)
class Assignment:
    """A task on its way to a worker of dask.

    known : the components of the case by their source files.
    run : a word for the run that the task belongs to, and the topic of its news.
    number : of the turn.
    folder : where the study is run; the case works there if there is such a folder.
    """

    task: Task
    known: Mapping[str, str]
    run: str
    number: int
    folder: str


_lock = threading.Lock()
_idle: list[tuple[str, Keeper]] = []
_busy: list[tuple[str, Keeper]] = []


def do(assignment: Assignment) -> Part | Unreadable | None:
    """Have a case done; None when its run has been stopped. Raises InputError when no worker process can be started."""
    host = get_worker()

    def tell(news: Progress | Way) -> None:
        host.log_event(assignment.run, (assignment.number, pickle.dumps(news)))

    mine = (assignment.run, _keeper(assignment))
    try:
        return mine[1].done(assignment.task, assignment.known, tell)
    finally:
        with _lock:
            _busy.remove(mine)
            if mine[1].ending.is_set():
                mine[1].drop()
            else:
                _idle.append(mine)


def stop(run: str) -> None:
    """Stop whatever this process does for a run, and end the worker processes that have served it."""
    with _lock:
        for of, keeper in _busy:
            if of == run:
                keeper.ending.set()
        _drop([pair for pair in _idle if pair[0] == run])


def _keeper(assignment: Assignment) -> Keeper:
    """A keeper that is idle, or a new one. Those of other runs go: their processes may have imported other plugins."""
    with _lock:
        _drop([pair for pair in _idle if pair[0] != assignment.run])
        if _idle:
            _, keeper = _idle.pop()
        else:
            keeper = Keeper(assignment.folder if os.path.isdir(assignment.folder) else None)
        _busy.append((assignment.run, keeper))
    return keeper


def _drop(pairs: list[tuple[str, Keeper]]) -> None:
    for pair in pairs:
        pair[1].drop()
        _idle.remove(pair)
