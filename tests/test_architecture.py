"""docs/architecture.md tells the truth: its list and its drawing of packages follow from the packages' docstrings.

After a change of a docstring, `.venv/bin/python tests/test_architecture.py` writes both anew.
"""

from __future__ import annotations

import ast
import inspect
import re
from collections.abc import Mapping, Set
from graphlib import TopologicalSorter

import pytest
from test_floors import HOUSE, rules_of

import nlsolve.plugin
import nlsolve.testing
from nlsolve.contracts.component import Component

PAGE = HOUSE.parent / "docs" / "architecture.md"
Rules = Mapping[str, Set[str]]


def upwards(rules: Rules) -> list[str]:
    """The packages from the bottom to the top; those on one level in the order of the alphabet."""
    sorter, order = TopologicalSorter(rules), []
    sorter.prepare()
    while sorter.is_active():
        level = sorted(sorter.get_ready())
        order += level
        sorter.done(*level)
    return order


def implied(rules: Rules, package: str) -> set[str]:
    """What the packages that `package` may import may import themselves, and so on down."""
    below = set(rules[package])
    return below.union(*(implied(rules, other) for other in below)) if below else set()


def arrows(rules: Rules) -> list[tuple[str, str]]:
    """Package and imported package, without the arrows that follow from others."""
    found = []
    for package in reversed(upwards(rules)):
        through = set().union(*(implied(rules, other) for other in rules[package]))
        found += [(package, other) for other in sorted(rules[package] - through)]
    return found


def purpose(package: str) -> str:
    """The first sentence of a package, or the first line of a module."""
    path = HOUSE / package / "__init__.py"
    docstring = ast.get_docstring(ast.parse((path if path.exists() else HOUSE / f"{package}.py").read_text("utf-8")))
    return (docstring or "").split("\n\n")[0].replace("\n", " ")


def packages(rules: Rules) -> str:
    """The list: what each package is for, and which it may import."""
    order = upwards(rules)
    rows = [
        f"| `{package}` | {purpose(package)} | {', '.join(sorted(rules[package], key=order.index)) or '–'} |"
        for package in order
    ]
    return "\n".join(["| package | what it is for | may import |", "| --- | --- | --- |", *rows])


def drawing(rules: Rules) -> str:
    """The drawing, in Mermaid."""
    return "\n".join(
        ["```mermaid", "flowchart TD", *(f"    {upper} --> {lower}" for upper, lower in arrows(rules)), "```"]
    )


BLOCKS = {"packages": packages, "drawing": drawing}


def block(name: str, text: str) -> re.Match[str]:
    """A generated block of the page, between its marks."""
    found = re.search(rf"(<!-- {name} -->\n)(.*?)(\n<!-- end of {name} -->)", text, flags=re.DOTALL)
    assert found, f"the page has no block {name!r}"
    return found


@pytest.mark.parametrize("name", BLOCKS)
def test_the_page_says_what_the_docstrings_say(name):
    found = block(name, PAGE.read_text(encoding="utf-8"))[2]
    assert found == BLOCKS[name](rules_of(HOUSE)), "run .venv/bin/python tests/test_architecture.py"


def test_arrows_that_follow_from_others_are_left_out():
    rules = {"a": set(), "b": {"a"}, "c": {"a", "b"}, "d": {"a"}}
    assert upwards(rules) == ["a", "b", "d", "c"]
    assert arrows(rules) == [("c", "b"), ("d", "a"), ("b", "a")]
    assert implied(rules, "c") == {"a", "b"}


def test_every_file_that_the_page_names_is_there():
    text = PAGE.read_text(encoding="utf-8")
    named = set(re.findall(r"`((?:nlsolve|plugins|tests|docs|studies|examples|benchmarks)/[\w./-]*)`", text))
    missing = {name for name in named if not (HOUSE.parent / name).exists()}
    assert len(named) > 10
    assert missing == set()


def test_every_package_of_plugins_is_named():
    text = PAGE.read_text(encoding="utf-8")
    assert {path.name for path in (HOUSE.parent / "plugins").glob("nlsolve_*") if f"`{path.name}`" not in text} == set()


def test_every_contract_is_listed_with_its_check():
    text = PAGE.read_text(encoding="utf-8")
    assert set(re.findall(r"`(check_\w+)`", text)) == {n for n in nlsolve.testing.__all__ if n.startswith("check_")}
    public = {name: getattr(nlsolve.plugin, name) for name in nlsolve.plugin.__all__}
    contracts = {name for name, thing in public.items() if inspect.isabstract(thing) and issubclass(thing, Component)}
    assert len(contracts) > 8
    assert {name for name in contracts if f"| `{name}` |" not in text} == set()


def write() -> None:
    """Write the generated blocks of the page anew."""
    text = PAGE.read_text(encoding="utf-8")
    for name, made in BLOCKS.items():
        found = block(name, text)
        text = text[: found.start(2)] + made(rules_of(HOUSE)) + text[found.end(2) :]
    PAGE.write_text(text, encoding="utf-8")


if __name__ == "__main__":
    write()
