"""The hooks that a plugin may implement, each with an example that the tests run. There is one hook.

A plugin is a module, found by its entry point in the group `nlsolve`. In the pyproject.toml of its package:

    [project.entry-points.nlsolve]
    honey = "honey"

The module may state the version of the plugin contract that it was written for (see `contract_version`).
"""

from __future__ import annotations

from collections.abc import Iterable

import pluggy

from nlsolve.contracts.component import Component

PROJECT = "nlsolve"
"""Name of the entry-point group, and the project name in the markers of hooks."""

hookspec = pluggy.HookspecMarker(PROJECT)
hookimpl = pluggy.HookimplMarker(PROJECT)
"""Marks the function of a plugin's module that implements a hook: `@hookimpl`."""


@hookspec
def nlsolve_components() -> Iterable[type[Component]]:  # type: ignore[empty-body]
    """The component classes that a plugin offers, of any contract: scenes, laws, discretizers, linear solvers, methods,
    refresh rules, iteration operators, predictors, globalisations, range rules and homotopy
    forms.

    Called once a process, when the registry is loaded. A class declares its kind as a literal; its fields are the
    parameters that a study may set. The module honey.py, all of it:

        from typing import Any, Literal

        from nlsolve.plugin import ConstitutiveLaw, hookimpl


        class Honey(ConstitutiveLaw):  # μ(ε̄²) = μ₀
            kind: Literal["honey"] = "honey"
            viscosity_at_rest: float = 10.0

            def viscosity(self, rate_squared: Any) -> Any:
                return self.viscosity_at_rest + 0.0 * rate_squared


        @hookimpl
        def nlsolve_components():
            return [Honey]

    When a hook raises, or returns anything but concrete component classes, its own plugin is left out and the others
    work: `nlsolve plugins` shows a row with the reason.
    """
