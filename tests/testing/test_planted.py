"""Every promise of every contract has a plugin that breaks it, which is found; first-party plugins keep all.

`python tests/testing/test_planted.py` prints the table: check, planted plugin, what is said.
"""

from __future__ import annotations

from typing import Any

import pytest
from planted_flows import DISCRETIZERS, LAWS, SCENES, SIMULATIONS, SYSTEMS
from planted_solvers import LINEAR, RULES, SOLVERS

from nlsolve.contracts.component import Component
from nlsolve.registry.classes import CONTRACTS
from nlsolve.registry.installed.entries import installed_plugins, names_of
from nlsolve.registry.offers import FIRST_PARTY
from nlsolve.registry.registry import Registry
from nlsolve.testing.kit.subjects import contract_of, verdicts_of
from nlsolve.testing.kit.verdicts import promise, verdicts
from nlsolve.testing.promises import require

PLANTED: list[tuple[str, str, str, Component]] = [
    *(("solver", check, name, plugin) for (check, name), plugin in SOLVERS.items()),
    *(("linear", check, name, plugin) for (check, name), plugin in LINEAR.items()),
    *((noun, check, check, plugin) for (noun, check), plugin in RULES.items()),
    *(("law", check, name, plugin) for (check, name), plugin in LAWS.items()),
    *(("discretizer", check, name, plugin) for (check, name), plugin in DISCRETIZERS.items()),
    *(("scene", check, name, plugin) for (check, name), plugin in SCENES.items()),
    *(("system", check, name, plugin) for (check, name), plugin in SYSTEMS.items()),
    *(("simulation", check, name, plugin) for (check, name), plugin in SIMULATIONS.items()),
]

SETTINGS: dict[str, dict[str, Any]] = {
    "published": {"problem": "powell-singular"},
    "p-laplacian": {"regularization": 0.1},  # with a smaller one differences of F say little of its Jacobian
}

ABSENT = {"kinsol", "petsc-snes"}
"""Kinds of libraries that need not be installed: the solve says so."""

SLOW = {"scipy-root"}


def first_party() -> list[Any]:
    others = {entry.name for entry in installed_plugins() if FIRST_PARTY not in names_of(entry)}
    registry = Registry.installed(others)
    return [
        pytest.param(cls, id=f"{noun}-{kind}", marks=[pytest.mark.slow] if kind in SLOW else [])
        for noun in CONTRACTS
        for kind, cls in registry.classes(noun).items()
    ]


@pytest.mark.parametrize(
    ("check", "plugin"),
    [pytest.param(check, plugin, id=f"{noun}-{check}-{name}") for noun, check, name, plugin in PLANTED],
)
def test_the_check_finds_the_planted_plugin(check: str, plugin: Component) -> None:
    found = {verdict.name: verdict for verdict in verdicts_of(plugin)}
    assert found[check].failure
    assert "\n" not in found[check].failure


@pytest.mark.parametrize("cls", first_party())
def test_first_party_plugins_keep_every_promise(cls: type[Component]) -> None:
    component = cls(**SETTINGS.get(cls.kind_name(), {}))
    found = verdicts_of(component)
    broken = {verdict.name: verdict.failure or "not reached" for verdict in found if not verdict.holds}
    if cls.kind_name() in ABSENT and "needs" in broken.get("solves", ""):
        pytest.skip(broken["solves"])
    assert broken == {}


def test_every_promise_has_a_planted_plugin() -> None:
    promised = {(contract_of(type(plugin)), verdict.name) for *_, plugin in PLANTED for verdict in verdicts_of(plugin)}
    planted = {(contract_of(type(plugin)), check) for _, check, _, plugin in PLANTED}
    missing = {(contract.__name__, name) for contract, name in promised - planted}
    shared = {("Scene", "expansion"), ("Scene", "check"), ("Predictor", "check")}
    assert missing - shared == set()


def test_a_check_that_never_ends_is_stopped() -> None:
    def check() -> None:
        with promise("ends", "it ends"):
            while True:
                pass

    assert verdicts(check, seconds=0.05)[0].failure.startswith("the check took too long")


def test_what_needs_a_broken_promise_is_not_reached() -> None:
    def check() -> None:
        with promise("first", "a number is made"):
            require(False, "no number")
            number = 1
        with promise("second", "the number is 1"):
            require(number == 1, "another number")
        with promise("third", "it exits"):
            raise SystemExit(3)

    first, second, third = verdicts(check)
    assert (first.failure, first.holds) == ("no number", False)
    assert (second.failure, second.reached, second.holds) == ("", False, False)
    assert third.failure.startswith("raised SystemExit: 3")
    with pytest.raises(AssertionError, match="no number"):
        check()


if __name__ == "__main__":
    for noun, check, name, plugin in PLANTED:
        verdict = next(verdict for verdict in verdicts_of(plugin) if verdict.name == check)
        print(f"| {noun} | {check} | {name} | {verdict.failure[:160]} |")
