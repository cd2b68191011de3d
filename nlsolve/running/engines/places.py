"""Where a case was when it ended: the file and line, and the component whose file that is."""

from __future__ import annotations

import re
import sys
import traceback
from collections.abc import Iterable, Iterator, Mapping
from types import FrameType
from typing import Any

from nlsolve.contracts.component import Component
from nlsolve.registry.classes import CONTRACTS

Frame = tuple[str, int]
"""File and line."""

FRAME = re.compile(r'^  File "(.+)", line (\d+) in ', re.MULTILINE)
"""A frame in what `faulthandler` writes, which begins with the innermost one."""


def origins(parts: Any) -> dict[str, str]:
    """Source file -> "solver 'newton'", for the components of a case, at any depth."""
    found: dict[str, list[str]] = {}
    for component in components_in(value for _, value in parts):
        file = getattr(sys.modules.get(type(component).__module__), "__file__", None)
        if file is not None:
            found.setdefault(file, []).append(named(component))
    return {file: " or ".join(dict.fromkeys(names)) for file, names in found.items()}


def components_in(values: Iterable[Any]) -> Iterator[Component]:
    """The components that have kinds, and those in their fields."""
    for value in values:
        if isinstance(value, Component):
            if value.noun in CONTRACTS:
                yield value
            yield from components_in(getattr(value, name) for name in type(value).model_fields)


def named(component: Component) -> str:
    """solver 'newton'"""
    return f"{component.noun} {component.kind_name()!r}"


def place(frames: Iterable[Frame], known: Mapping[str, str]) -> str:
    """at file:line (solver 'newton'): the innermost frame of a component, or else the innermost; empty without any.

    frames : the innermost first.
    """
    all_of_them = list(frames)
    for file, line in all_of_them:
        if file in known:
            return f" at {file}:{line} ({known[file]})"
    return " at {}:{}".format(*all_of_them[0]) if all_of_them else ""


def frames_of_error(error: BaseException) -> list[Frame]:
    """The frames that an exception has passed, the innermost first."""
    return [(frame.filename, frame.lineno or 0) for frame in reversed(traceback.extract_tb(error.__traceback__))]


def frames_from(frame: FrameType | None) -> Iterator[Frame]:
    """A frame and its callers."""
    while frame is not None:
        yield frame.f_code.co_filename, frame.f_lineno
        frame = frame.f_back


def frames_of_dump(dump: str) -> list[Frame]:
    """The frames of the main thread in the last of what `faulthandler` has written."""
    last = dump[max(dump.rfind("Current thread"), dump.rfind("Stack (most recent call first)"), 0) :]
    return [(file, int(line)) for file, line in FRAME.findall(last.split("\n\n")[0])]
