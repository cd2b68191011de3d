"""`--disable-plugin NAME`: plugins that neither this process nor its workers import."""

from __future__ import annotations

import os
from collections.abc import Sequence

from nlsolve.registry.installed.entries import installed_plugins, names_of
from nlsolve.registry.problems import StudyError, did_you_mean
from nlsolve.registry.registry import DISABLE


def disable(names: Sequence[str]) -> None:
    """Keep these plugins, or packages of plugins, from being imported, by the environment that workers inherit.

    Raises StudyError for a name that no installed plugin has.
    """
    known = sorted(set().union(*map(names_of, installed_plugins())))
    for name in names:
        if name not in known:
            raise StudyError(f"--disable-plugin {name}: no such plugin; {did_you_mean(name, known)}")
    before = [name for name in os.environ.get(DISABLE, "").split(",") if name]
    if names:
        os.environ[DISABLE] = ",".join(dict.fromkeys([*before, *names]))
