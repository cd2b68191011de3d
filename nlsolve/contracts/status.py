"""How a solve ended. Each ending is a value with a sentence for the reader of a table."""

from __future__ import annotations

from enum import Enum
from functools import cache


class Status(Enum):
    """The ending of one solve or of one case."""

    CONVERGED = "the stopping test was met"
    OTHER_ROOT = "the stopping test was met at a root other than the known ones"
    BUDGET_SPENT = "the iterations allowed were used up before the stopping test was met"
    INACCURATE = "the equations were solved, and the error is estimated as larger than was asked for"
    STAGNATED = "the residual stopped falling well above the tolerance"
    DIVERGED = "the residual grew far beyond its first value"
    NON_FINITE = "a residual, a coefficient or an iterate was not a finite number"
    OUT_OF_DOMAIN = "the method reached a finite state where the residual has no finite value"
    SINGULAR_TANGENT = "a tangent could not be factorised: it is singular to working precision"
    UNSOLVED_TANGENT = "a linear system with the tangent was not solved to the accuracy asked for"
    RANGE_EXHAUSTED = "the range of the series fell to nothing before the end of the path"
    BAD_CLOUD = "the nodes no longer carry a discretisation: coincident nodes or supports without enough neighbours"
    ILL_CONDITIONED = "the local systems of the discretisation are singular to working precision"
    NOT_APPLICABLE = "the method does not apply to this problem"
    CRASHED = "the case stopped on an error in the program or in a plugin"
    TIMED_OUT = "the case was stopped because it took more seconds than its limit"
    OUT_OF_MEMORY = "the case was stopped because it held more memory than its limit, or than there is"

    @property
    @cache
    def word(self) -> str:
        """The short name used in the `status` column."""
        return self.name.lower().replace("_", " ")

    @classmethod
    def of(cls, word: str) -> Status:
        """The status whose `word` stands in a result frame. Raises ValueError for any other word."""
        known = cls._by_word()
        if word not in known:
            raise ValueError(f"{word!r} is no status: there are {', '.join(known)}")
        return known[word]

    @classmethod
    @cache
    def _by_word(cls) -> dict[str, Status]:
        return {status.word: status for status in cls}

    @property
    def sentence(self) -> str:
        """What happened, in a sentence."""
        return str(self.value)


STOPPED = frozenset({Status.TIMED_OUT, Status.OUT_OF_MEMORY})
"""Statuses of cases that were stopped at a limit."""


class InputError(ValueError):
    """A mistake of the caller: one sentence that names the place, the value there, and the way out."""


class SolveError(Exception):
    """A computation cannot go on. The driver turns this error into the status of the outcome; a user sees no traceback.

    status : the kind of ending.
    detail : a sentence on this ending; empty when the sentence of the status is enough.
    """

    def __init__(self, status: Status, detail: str = "") -> None:
        super().__init__(detail or status.sentence)
        self.status, self.detail = status, detail


class CaseStopped(BaseException):
    """A case has reached one of its limits. Raised wherever the case is; no plugin catches it with its other errors.

    status : which limit.
    detail : a sentence with the limit and the place.
    """

    def __init__(self, status: Status, detail: str) -> None:
        super().__init__(detail)
        self.status, self.detail = status, detail
