"""docs/reference/ tells the truth: columns, statuses, doubts, kinds, hooks, commands and names are those of the code.

After a change of one of them, `.venv/bin/python tests/docs/test_reference.py` writes the pages anew.
"""

from __future__ import annotations

import inspect
import math
import re
from collections.abc import Callable, Iterator
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest
import typer

import nlsolve
import nlsolve.plugin
import nlsolve.testing
from nlsolve.cli.app import app
from nlsolve.contracts.component import Component
from nlsolve.contracts.status import Status
from nlsolve.flow.validity import LIMITS
from nlsolve.registry.classes import CONTRACTS
from nlsolve.registry.installed import hookspecs
from nlsolve.registry.installed.entries import installed_plugins, names_of
from nlsolve.registry.offers import FIRST_PARTY
from nlsolve.registry.registry import Registry
from nlsolve.results.columns import DIAGNOSTICS, FRAMES, RENAMED, Column

ROOT = Path(__file__).parents[2]
FOLDER = ROOT / "docs" / "reference"
NOTE = "This page is generated (`.venv/bin/python tests/docs/test_reference.py`), and a test holds it to the code."

SURROUNDINGS = "nlsolve/running/engines/processes/surroundings.py"
OTHER_DOUBTS = {
    "nlsolve/algebra/root_search.py": "no root is near",
    "nlsolve/solving/simulate.py": "steps with no counted",
    SURROUNDINGS: "work were done in other processes and not counted",
    "nlsolve/flow/validity.py": "the error could not be estimated",
}
"""Where a doubt is made that is not an audit above its limit, and words of its sentence."""


def table(head: str, rows: Iterator[list[str]]) -> str:
    """A table in Markdown; `head` has its headings, parted by bars."""
    written = [" | ".join(" ".join(cell.replace("|", r"\|").split()) for cell in row) for row in rows]
    rule = " | ".join("---" for _ in head.split(" | "))
    return "\n".join(f"| {row} |" for row in (head, rule, *written))


def sentence(thing: Any) -> str:
    """The first paragraph of a docstring."""
    return " ".join(re.split(r"\n\s*\n", inspect.getdoc(thing) or "")[0].split())


def columns() -> str:
    parts = [f"# Columns of the results\n\n{NOTE}\n"]
    for name, frame in {**FRAMES, "diagnose": DIAGNOSTICS}.items():
        meaning = "what `nlsolve diagnose` prints" if name == "diagnose" else f"the frame `{name}`"
        parts.append(f"## `{name}`\n\n{meaning[0].upper()}{meaning[1:]}.\n")
        parts.append(table("column | unit | symbol | meaning", map(of_column, frame.values())) + "\n")
    parts.append(
        "Behind these stand, in `runs`, all parameters of the case, dotted (`solver.order`), and what a scene measures "
        "that no column knows (`measured.NAME`); in `steps`, what a method notes of a step (`note.NAME`).\n\n"
        "## Columns that had another name\n"
    )
    parts.append(table("once | now", ([f"`{old}`", f"`{new}`"] for old, new in RENAMED.items())) + "\n")
    return "\n".join(parts)


def of_column(column: Column) -> list[str]:
    said = column.meaning + ("; read from a clock" if column.timed else "")
    return [f"`{column.name}`", column.unit, column.symbol.replace(r"\|", r"\Vert "), said]


def endings() -> str:
    audits = (
        [
            f"`{name}`",
            "0" if limit.largest == 0 else f"{limit.largest:.3g}",
            limit.sentence,
            "yes" if limit.doubt else "no, it is told only",
        ]
        for name, limit in LIMITS.items()
    )
    return f"""# How a case ends, and when it is doubted

{NOTE}

## Statuses

The column `status` has the word, `message` the sentence or one that says more. `Status.of(word)` is the value.

{table("word | what has happened", ([status.word, status.sentence] for status in Status))}

## Doubts

The column `doubt` of a converged case says in sentences why its numbers may be wrong, and the way out; it is empty when
nothing is known against them. A flow is audited from its own solution; above the limit an audit is a doubt:

{table("audit | limit | what a larger value means | a doubt", audits)}

Other reasons for doubt:

- a system met its stopping test, but {OTHER_DOUBTS["nlsolve/algebra/root_search.py"]}: Newton steps lead away;
- a method took {OTHER_DOUBTS["nlsolve/solving/simulate.py"]} work, so that its counts tell less than it did;
- seconds of {OTHER_DOUBTS[SURROUNDINGS]}, or processes were left running;
- audits could not be made, or {OTHER_DOUBTS["nlsolve/flow/validity.py"]}, because an operator could not be built.
"""


def first_party() -> Registry:
    """The plugins that ship with nlsolve, whatever else is installed."""
    others = {entry.name for entry in installed_plugins() if FIRST_PARTY not in names_of(entry)}
    return Registry.installed(others)


def kinds() -> str:
    registry = first_party()
    parts = [
        f"# Contracts, kinds and the hook\n\n{NOTE}\n\nWhat every kind takes is in [all keys of a study]"
        "(../study-keys.md), what a contract asks of a class in [plugins](../plugins.md), its class in [the plugin "
        "authors' names](plugin.md).\n"
    ]
    for noun, contract in CONTRACTS.items():
        link = f"../plugins.md#{contract.__name__.lower()}"
        parts.append(f"## {noun}\n\n[{contract.__name__}]({link}): {sentence(contract)}\n")
        offered = registry.offered(noun, absent_too=True).items()
        parts.append(
            table(
                "kind | what it is", ([f"[`{kind}`](../study-keys.md#{kind})", sentence(cls)] for kind, cls in offered)
            )
            + "\n"
        )
    parts.append("## The hooks\n")
    hooks = {name: hook for name, hook in vars(hookspecs).items() if hasattr(hook, "nlsolve_spec")}
    for name, hook in hooks.items():
        parts.append(
            f"A plugin of a package offers its classes by `{name}`:\n\n"
            + "\n\n".join(markdown(inspect.getdoc(hook) or ""))
            + "\n"
        )
    return "\n".join(parts)


def markdown(text: str) -> Iterator[str]:
    """The paragraphs of a docstring, and its code."""
    for part in re.split(r"\n\n(?=\S)", text):
        words, _, code = part.partition("\n\n")
        yield words
        if code:
            yield f"```python\n{inspect.cleandoc(code)}\n```"


def commands() -> str:
    group: Any = typer.main.get_command(app)
    parts = [f"# Commands\n\n{NOTE}\n"]
    for name, command in group.commands.items():
        arguments = [each for each in command.params if each.param_type_name == "argument"]
        options = [each for each in command.params if each.param_type_name == "option"]
        usage = " ".join([f"nlsolve {name}", *(str(each.metavar or each.name) for each in arguments)])
        said = " ".join(command.help.split())
        parts.append(f"## {name}\n\n`{usage}`\n\n{said}\n")
        rows = (
            [
                f"`{each.metavar or each.name}`" if each in arguments else option(each),
                (each.help or "").replace("\\", ""),
            ]
            for each in arguments + options
        )
        parts.append(table("argument | meaning", rows) + "\n")
    return "\n".join(parts)


def option(each: Any) -> str:
    value = "" if each.is_flag else f" {each.metavar or each.name.upper()}"
    return f"`{each.opts[0]}{value}`" + (", may be repeated" if each.multiple else "")


def directive(door: ModuleType, name: str) -> str:
    """How autodoc documents a name: what is neither class nor function has its docstring where it is assigned."""
    thing = getattr(door, name)
    if inspect.isclass(thing):
        return f"autoclass:: {door.__name__}.{name}\n   :members:\n   :exclude-members: model_config"
    if inspect.isfunction(thing):
        return f"autofunction:: {door.__name__}.{name}"
    assigned = rf"^{name}(: TypeAlias)? = "
    (home,) = (
        path for path in (ROOT / "nlsolve").rglob("*.py") if re.search(assigned, path.read_text("utf-8"), re.MULTILINE)
    )
    module = home.relative_to(ROOT).with_suffix("").as_posix().replace("/", ".")
    return f"autodata:: {module}.{name}\n   :no-value:"


def names(door: ModuleType, title: str, words: str) -> Callable[[], str]:
    """The page of the public names of a module, which autodoc writes."""

    def page() -> str:
        parts = [f"# {title}\n\n{NOTE} Sphinx writes the docstrings into the site.\n\n{words}\n"]
        for name in door.__all__:
            if name == "__version__":
                continue
            parts.append(f"## {name}\n")
            if door is not nlsolve and name in nlsolve.__all__:
                parts.append(f"The same as [`nlsolve.{name}`](nlsolve.md#{name.lower()}).\n")
                continue
            parts.append(f"```{{eval-rst}}\n.. {directive(door, name)}\n```\n")
        return "\n".join(parts)

    return page


PAGES: dict[str, Callable[[], str]] = {
    "columns.md": columns,
    "endings.md": endings,
    "kinds.md": kinds,
    "commands.md": commands,
    "nlsolve.md": names(
        nlsolve, "Names for users: `nlsolve`", "`nlsolve.__version__` is the version that is installed."
    ),
    "plugin.md": names(
        nlsolve.plugin, "Names for plugin authors: `nlsolve.plugin`", "A plugin imports nothing else of nlsolve."
    ),
    "testing.md": names(
        nlsolve.testing, "Checks: `nlsolve.testing`", "Each raises AssertionError with the promise that is broken."
    ),
}


@pytest.mark.parametrize("name", PAGES)
def test_the_page_is_up_to_date(name: str) -> None:
    assert (FOLDER / name).read_text(encoding="utf-8") == PAGES[name](), (
        "run .venv/bin/python tests/docs/test_reference.py"
    )


def test_no_other_page_is_there() -> None:
    assert {path.name for path in FOLDER.iterdir()} == set(PAGES)


@pytest.mark.parametrize("path", OTHER_DOUBTS)
def test_other_doubts_are_in_the_code(path: str) -> None:
    source = " ".join((ROOT / path).read_text(encoding="utf-8").replace('" \n', "").split())
    assert OTHER_DOUBTS[path] in source


def test_every_limit_and_contract_has_its_row() -> None:
    assert all(math.isfinite(limit.largest) for limit in LIMITS.values())
    assert all(issubclass(contract, Component) for contract in CONTRACTS.values())


if __name__ == "__main__":
    FOLDER.mkdir(exist_ok=True)
    for name, page in PAGES.items():
        (FOLDER / name).write_text(page(), encoding="utf-8")
