"""The two doors say what they hold: every public name is documented, and what the users' functions raise is public."""

from __future__ import annotations

import importlib
import inspect
import pkgutil
import re
from types import ModuleType
from typing import Any

import pytest

import nlsolve
import nlsolve.plugin

DOORS = (nlsolve, nlsolve.plugin)
NAMES = [(door, name) for door in DOORS for name in door.__all__ if name != "__version__"]
CONVERTED = {
    "Invalid": "StudyError",
    "_Refused": "StudyError",
    "FigureError": "a note of `Results`",
    "NotPortable": "a note of `Results`",
}
"""Exceptions inside the house that no user sees, and what becomes of them."""

USERS = [
    nlsolve.solve,
    nlsolve.compare,
    nlsolve.run,
    nlsolve.Study.from_toml,
    nlsolve.Study.from_dict,
    nlsolve.Results.table,
]


def words(text: str) -> set[str]:
    return {word.lower().rstrip("s") for word in re.findall(r"[^\W\d_]+", re.sub(r"([a-z])([A-Z])", r"\1 \2", text))}


def modules() -> list[ModuleType]:
    return [
        importlib.import_module(found.name)
        for found in pkgutil.walk_packages(nlsolve.__path__, "nlsolve.")
        if not found.name.startswith("nlsolve.cli")
    ]


def errors() -> dict[str, type[Exception]]:
    """The exceptions that the house defines."""
    return {
        name: value
        for module in modules()
        for name, value in vars(module).items()
        if isinstance(value, type) and issubclass(value, Exception) and value.__module__ == module.__name__
    }


def docstring(value: Any) -> str:
    """Its own, not one that it inherits or that a dataclass makes."""
    own = value.__dict__.get("__doc__") if isinstance(value, type) else value.__doc__
    text = inspect.cleandoc(own or "")
    return "" if isinstance(value, type) and text.startswith(f"{value.__name__}(") else text


@pytest.mark.parametrize(("door", "name"), NAMES, ids=[f"{door.__name__}.{name}" for door, name in NAMES])
def test_a_public_name_says_more_than_its_name(door, name):
    said = docstring(getattr(door, name))
    assert len(words(said) - words(name)) >= 3, f"{door.__name__}.{name}: {said!r}"


@pytest.mark.parametrize("door", DOORS, ids=lambda door: door.__name__)
def test_nothing_else_is_public(door):
    public = {
        name
        for name in dir(door)
        if not name.startswith("_") and not isinstance(getattr(door, name), ModuleType) and name != "annotations"
    }
    assert public == set(door.__all__) - {"__version__"}
    assert list(door.__all__) == sorted(door.__all__)


def test_every_error_of_the_house_is_public_or_converted():
    public = set(nlsolve.__all__) | set(nlsolve.plugin.__all__)
    assert set(errors()) - public == set(CONVERTED)
    assert {name for name in errors() if name.endswith("Error")} <= set(nlsolve.__all__) | set(CONVERTED)


@pytest.mark.parametrize("function", USERS, ids=lambda function: function.__qualname__)
def test_what_a_function_says_that_it_raises_is_public(function):
    said = re.findall(r"\b\w+Error\b", inspect.getdoc(function) or "")
    assert said, "it does not say what it raises"
    assert set(said) <= set(nlsolve.__all__)


def test_the_mistakes_of_a_caller_are_one_kind_of_error():
    assert issubclass(nlsolve.StudyError, nlsolve.InputError)
    assert issubclass(nlsolve.StoreError, nlsolve.InputError)
    assert issubclass(nlsolve.InputError, ValueError)


def test_a_name_that_is_not_there_is_answered_with_the_other_door():
    with pytest.raises(AttributeError, match=r"what plugins are written with is in nlsolve\.plugin"):
        _ = nlsolve.System
