"""The door for plugins: one hook, found through the entry-point group `nlsolve`.

# pyproject.toml                          # my_plugin.py
[project.entry-points.nlsolve]            from nlsolve import ConstitutiveLaw, hookimpl
mine = "my_plugin"
                                          @hookimpl
                                          def nlsolve_components():
                                              return [MyLaw]
"""

from __future__ import annotations

from collections.abc import Iterable

import pluggy

from nlsolve.contracts.component import Component

PROJECT = "nlsolve"
"""Name of the entry-point group and prefix of the hooks."""

hookspec = pluggy.HookspecMarker(PROJECT)
hookimpl = pluggy.HookimplMarker(PROJECT)


@hookspec
def nlsolve_components() -> Iterable[type[Component]]:  # type: ignore[empty-body]
    """The component classes this plugin offers: laws, scenes, discretizers, linear solvers, solvers, refresh rules."""
