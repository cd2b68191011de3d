"""Every hook is documented with an example, and the example works as it stands there."""

from __future__ import annotations

import inspect
import re
import tomllib
from collections.abc import Callable
from textwrap import dedent
from types import ModuleType

import pluggy
import pytest

from nlsolve.registry.installed import hookspecs
from nlsolve.registry.registry import Registry
from nlsolve.testing import check_law


def hooks() -> list[str]:
    """The names of the hooks that the specification declares."""
    manager = pluggy.PluginManager(hookspecs.PROJECT)
    manager.add_hookspecs(hookspecs)
    return [name for name in dir(hookspecs) if manager.parse_hookspec_opts(hookspecs, name) is not None]


def example_of(documented: Callable[..., object] | ModuleType) -> str:
    """The indented block of a docstring."""
    text = inspect.getdoc(documented) or ""
    (block,) = re.findall(r"(?:^    .*\n|^\n)*^    .*", text, flags=re.MULTILINE)
    return dedent(block)


def test_the_hooks():
    assert hooks() == ["nlsolve_components"]


@pytest.mark.parametrize("name", hooks())
def test_the_example_of_a_hook_is_a_plugin_that_registers(name):
    module = ModuleType("honey")
    exec(compile(example_of(getattr(hookspecs, name)), name, "exec", dont_inherit=True), module.__dict__)
    registry = Registry()
    registry.add(module, "honey 1.0")
    (row,) = registry.plugins()
    assert (row.noun, row.kind, row.failure) == ("law", "honey", None)
    law = registry.classes("law")["honey"]()
    check_law(law)  # type: ignore[arg-type]


def test_the_entry_point_of_the_example_is_in_the_group_that_is_read():
    assert tomllib.loads(example_of(hookspecs)) == {
        "project": {"entry-points": {hookspecs.PROJECT: {"honey": "honey"}}}
    }
