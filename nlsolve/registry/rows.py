"""What `nlsolve plugins` prints: a row for each class that a plugin offers, and for each plugin that failed."""

from __future__ import annotations

import inspect
from dataclasses import dataclass
from typing import Any

from pydantic.fields import FieldInfo
from pydantic_core import to_jsonable_python

from nlsolve.contracts.component import Component


@dataclass(frozen=True)
class Parameter:
    """One field of a component, as `nlsolve plugins` prints it."""

    name: str
    type: str
    default: Any
    description: str


@dataclass(frozen=True)
class PluginRow:
    """One row of `nlsolve plugins`: an offered component class, or a plugin that failed.

    source : distribution, version and module that it comes from.
    failure : why the plugin or the kind cannot be used; None when it can.
    meaning : the first paragraph of its class's docstring.
    """

    noun: str
    kind: str
    source: str
    parameters: tuple[Parameter, ...] = ()
    failure: str | None = None
    meaning: str = ""


def meaning_of(cls: type[Component]) -> str:
    """The first paragraph of a class's own docstring, in one line; empty when it has none."""
    return " ".join(inspect.cleandoc(cls.__doc__ or "").partition("\n\n")[0].split())


def parameters_of(cls: type[Component]) -> tuple[Parameter, ...]:
    """The fields of a class of components, without its kind."""
    return tuple(_parameter(name, info) for name, info in cls.model_fields.items() if name != "kind")


def _parameter(name: str, info: FieldInfo) -> Parameter:
    default = None if info.is_required() else to_jsonable_python(info.get_default(call_default_factory=True))
    annotation = info.annotation
    words = annotation.__name__ if isinstance(annotation, type) else str(annotation).replace("typing.", "")
    return Parameter(name, words, "required" if info.is_required() else default, info.description or "")


def sentence_of(error: BaseException) -> str:
    """Exception type and the first line of its text."""
    return f"{type(error).__name__}: {str(error).strip()}".splitlines()[0]
