"""Cases on the machines of a cluster, by dask.distributed: each in a worker process that a worker of dask keeps.

A worker of dask runs one task a thread; the task has its case done by a worker process of nlsolve's own on that
machine, so that it has the same limits and the same endings as here. What dask calls a worker is called a host below.
"""

from __future__ import annotations

import os
import pickle
import secrets
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import replace
from typing import Any

from distributed import Client, Future, LocalCluster
from distributed.scheduler import KilledWorker

from nlsolve.contracts.status import InputError, Status
from nlsolve.registry.problems import StudyError
from nlsolve.results.costs.lanes import SHARED
from nlsolve.results.frames import Part
from nlsolve.running.engines import host
from nlsolve.running.engines.engine import Turn
from nlsolve.running.engines.execution import part_without_record
from nlsolve.running.engines.places import origins
from nlsolve.running.engines.processes.travel import Task, Unreadable
from nlsolve.running.engines.side_by_side import Crew, Report, SideBySide
from nlsolve.running.store.identity import code_of

SECONDS_TO_CONNECT = 10
"""Time for a scheduler to answer [s]."""


GONE = "the scheduler of the cluster is gone: the finished cases are kept, and the same command does the rest"


class Cluster(SideBySide):
    """A cluster whose scheduler is at an address, or one within this process.

    jobs : cases at a time; None: as many as the cluster has threads at the time.
    """

    def __init__(self, jobs: int | None, scheduler: str | None = None) -> None:
        super().__init__(SHARED)
        self.jobs, self.scheduler = jobs, scheduler

    def crew(self) -> Crew:
        """The hosts of the cluster. Raises StudyError when no scheduler answers."""
        return _Hosts(self.jobs, self.scheduler)


class _Hosts(Crew):
    """What the scheduler of a cluster gives tasks to; it gives those of a host that is lost to another one."""

    def __init__(self, jobs: int | None, scheduler: str | None) -> None:
        super().__init__()
        self.jobs, self.token = jobs, secrets.token_hex(4)
        self._cluster: Any = None
        if scheduler is None:
            self._cluster = LocalCluster(
                n_workers=1, threads_per_worker=jobs, processes=False, dashboard_address="127.0.0.1:0"
            )
        try:
            address = self._cluster or scheduler
            self._client = Client(address, timeout=SECONDS_TO_CONNECT, set_as_default=False, name="nlsolve")
        except (OSError, ValueError) as error:
            raise StudyError(
                f"scheduler = {scheduler!r}: no scheduler of dask answers there ({error}): give the address that "
                "`dask scheduler` prints, such as tcp://10.0.0.1:8786"
            ) from error
        self._given: dict[int, tuple[Turn, Future]] = {}
        self._client.subscribe_topic(self.token, self._told)

    @property
    def room(self) -> int:
        with _reaching():
            return self.jobs or max(1, sum(self._client.nthreads().values()))

    def start(self, turn: Turn, task: Task) -> None:
        parts = turn.case.parts
        assignment = host.Assignment(
            replace(task, code=code_of(value for _, value in parts)),
            origins(parts),
            self.token,
            turn.number,
            os.getcwd(),
        )
        key = f"nlsolve-{turn.case.id}-{self.token}-{turn.number}"
        with _reaching():
            future = self._client.submit(host.do, assignment, key=key, pure=False)
        self._given[turn.number] = turn, future
        future.add_done_callback(lambda done: self.reports.put(Report(turn, _ending(task, done))))

    def free(self, turn: Turn) -> None:
        self._given.pop(turn.number)

    def end(self) -> None:
        with suppress(OSError):  # where the scheduler is gone there is nobody to tell
            self._client.cancel([future for _, future in self._given.values()])
            self._client.run(host.stop, self.token, on_error="ignore")
        self._client.close()
        if self._cluster is not None:
            self._cluster.close()

    def _told(self, event: tuple[float, tuple[int, bytes]]) -> None:
        """Progress or a way, as `host.do` has sent it."""
        _, (number, news) = event
        given = self._given.get(number)
        if given is not None:
            self.reports.put(Report(given[0], pickle.loads(news)))


@contextmanager
def _reaching() -> Iterator[None]:
    """Turn a scheduler that cannot be reached into an InputError."""
    try:
        yield
    except OSError as error:
        raise InputError(GONE) from error


def _ending(task: Task, done: Future) -> Part | Exception:
    """The part of a task that has ended, or the error that ends the run."""
    if done.status == "cancelled":
        return InputError(GONE)
    try:
        found: Part | Unreadable = done.result()
    except KilledWorker:
        detail = "each worker of the cluster that ran it was lost"
        return part_without_record(task.case, task.parameters, Status.CRASHED, detail, "lost worker")
    except InputError as error:
        return error
    except Exception as error:  # whatever a host lacks, which is no fault of the case
        found = Unreadable(f"{type(error).__name__}: {error}")
    if isinstance(found, Unreadable):
        return InputError(
            f"a worker of the cluster cannot run case {task.case} ({found.reason}): nlsolve, the plugins and the files "
            "of the study must be there as they are here"
        )
    return found
