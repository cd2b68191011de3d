"""Flows to solve: the stirring tool of the 2015 paper, and flows with an exact solution or a published benchmark."""

from __future__ import annotations

from collections.abc import Iterable

from nlsolve.plugin import Component, hookimpl
from nlsolve_scenes.cavity import Cavity
from nlsolve_scenes.channel import Channel
from nlsolve_scenes.couette import Couette
from nlsolve_scenes.eccentric import EccentricCylinders
from nlsolve_scenes.manufactured import Manufactured
from nlsolve_scenes.stirring_tool import StirringTool


@hookimpl
def nlsolve_components() -> Iterable[type[Component]]:
    return [StirringTool, Channel, Couette, EccentricCylinders, Cavity, Manufactured]
