"""The section `limits` of a study: what one case may cost before it is stopped."""

from __future__ import annotations

import re
from typing import Any, ClassVar

from pydantic import Field, field_validator

from nlsolve.contracts.component import Component

UNITS = {"B": 1, "kB": 10**3, "MB": 10**6, "GB": 10**9, "TB": 10**12, "KiB": 2**10, "MiB": 2**20, "GiB": 2**30}
UNITS["TiB"] = 2**40
"""Bytes in each unit of memory."""

SIZE = re.compile(rf"\s*(\d+(?:\.\d+)?)\s*({'|'.join(UNITS)})\s*")


class Limits(Component):
    """What one run of a case may cost before it is stopped and becomes a row that says so.

    They do not change what a case computes, so that they are part of its identity only where a study sweeps them.
    """

    noun: ClassVar[str] = "limits"

    seconds: float = Field(3600.0, gt=0, description="time that passes on the wall while the case runs [s]")
    memory: str = Field("4 GiB", description='resident memory of the case and of all its processes, such as "500 MB"')

    @field_validator("memory", mode="before")
    @classmethod
    def _is_a_size(cls, given: Any) -> Any:
        if not (isinstance(given, str) and SIZE.fullmatch(given) and bytes_of(given) > 0):
            raise ValueError(f'should be a number with a unit ({", ".join(UNITS)}), such as "4 GiB"')
        return given

    @property
    def bytes(self) -> int:
        """The memory in bytes."""
        return bytes_of(self.memory)


def bytes_of(size: str) -> int:
    """Number of bytes in a size such as "4 GiB". Raises ValueError for any other text."""
    found = SIZE.fullmatch(size)
    if found is None:
        raise ValueError(f"{size!r} is no number with a unit of memory")
    return round(float(found[1]) * UNITS[found[2]])
