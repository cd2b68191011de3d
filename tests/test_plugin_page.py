"""docs/plugins.md tells the truth: its plugins are those of `nlsolve new`, its promises those of `nlsolve check`.

After a change of a template or a check, `.venv/bin/python tests/test_plugin_page.py` writes the page anew.
"""

from __future__ import annotations

import re
import sys
from collections.abc import Iterator
from pathlib import Path
from types import ModuleType
from typing import Any

from nlsolve.cli.plugins.checking import PAGE as NAMED
from nlsolve.cli.plugins.scaffold import CONTRACTS, files_of
from nlsolve.contracts.component import Component
from nlsolve.testing.kit.subjects import CHECKS, contract_of, verdicts_of

ROOT = Path(__file__).parent.parent
PAGE = ROOT / NAMED

BEGIN, END = "<!-- contracts -->\n", "<!-- end of contracts -->\n"
"""Between these lines the page is generated."""

TITLES = {
    "solver": "Your first solver",
    "law": "Your first law",
    "discretizer": "Your first discretizer",
    "scene": "Your first scene",
    "system": "Your first system",
    "pde": "Your first partial differential equation",
    "linear-solver": "Your first linear solver",
    "refresh": "Your first refresh rule",
    "operator": "Your first iteration operator",
    "predictor": "Your first predictor",
    "globalization": "Your first globalisation",
    "range": "Your first range rule",
    "form": "Your first homotopy form",
}

OWN_PROBLEM = """\
A scene of its own, such as an equation that another library assembles, builds its `Simulation`. [Your own
PDE](guides/own-pde.md) says how; an example with an exact solution is
[examples/p_laplace_by_scikit_fem.py](../examples/p_laplace_by_scikit_fem.py).

"""


def scaffold_of(contract: str) -> tuple[str, str, Component]:
    """The text of a plugin, that of its study, and an instance of its class."""
    files = files_of(contract, f"my-{contract}", package=False)
    name = f"my_{contract.replace('-', '_')}"
    module = sys.modules[name] = ModuleType(name)
    try:
        exec(compile(files[f"{name}.py"], f"{name}.py", "exec"), module.__dict__)
    finally:
        del sys.modules[name]
    cls: Any = next(
        thing
        for thing in vars(module).values()
        if isinstance(thing, type) and issubclass(thing, Component) and thing.__module__ == name
    )
    return files[f"{name}.py"], files[f"{name}.toml"], cls()


def promises(component: Component) -> Iterator[str]:
    """A row for each promise of a component's contract; all of them must hold."""
    for verdict in verdicts_of(component):
        assert verdict.holds, f"{component.called()}: {verdict.name}: {verdict.failure}"
        meaning = verdict.meaning.replace("|", r"\|")
        yield f"| {verdict.name} | {meaning} |\n"


def text(page: str) -> str:
    """The page as it should be."""
    before, after = page.partition(BEGIN)[0], page.partition(END)[2]
    parts = list[str]()
    for contract in CONTRACTS:
        plugin, study, component = scaffold_of(contract)
        lines = len([line for line in plugin.splitlines() if line])
        parts.append(
            f"## {contract_of(type(component)).__name__}\n\n{OWN_PROBLEM if contract == 'pde' else ''}"
            f"{TITLES[contract]}, in {lines} lines, as "
            f"`nlsolve new {contract} my-{contract}` writes it:\n\n"
            f"<!-- file: my_{contract.replace('-', '_')}.py -->\n```python\n{plugin}```\n\n"
            f"and the study that uses it:\n\n```toml\n{study}```\n\nWhat it is held to:\n\n"
            "| promise | what is promised |\n| --- | --- |\n" + "".join(promises(component))
        )
    return before + BEGIN + "\n".join(parts) + END + after


def test_the_page_is_up_to_date() -> None:
    page = PAGE.read_text(encoding="utf-8")
    assert page == text(page)


def test_first_plugins_are_short() -> None:
    shown = re.findall(r"Your first (.+), in (\d+) lines", PAGE.read_text(encoding="utf-8"))
    lines = {contract: int(count) for contract, count in shown}
    assert len(lines) == len(CONTRACTS)
    assert lines["solver"] <= 40
    assert lines["law"] <= 15


def test_every_contract_has_a_section() -> None:
    headings = {line[3:] for line in PAGE.read_text(encoding="utf-8").splitlines() if line.startswith("## ")}
    assert {contract.__name__ for contract in CHECKS} <= headings
    assert "One file is a plugin" in headings


if __name__ == "__main__":
    PAGE.write_text(text(PAGE.read_text(encoding="utf-8")), encoding="utf-8")
