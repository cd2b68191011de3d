"""The entry points of installed plugins, and the names by which they are told and disabled."""

from __future__ import annotations

from importlib.metadata import EntryPoint, entry_points

from nlsolve.registry.installed.hookspecs import PROJECT


def installed_plugins() -> list[EntryPoint]:
    """The entry points of all installed plugins, in the order of their names."""
    return sorted(entry_points(group=PROJECT), key=lambda entry: (entry.name, entry.value))


def names_of(entry: EntryPoint) -> set[str]:
    """The names by which a plugin is disabled: its own, and that of its package."""
    return {entry.name} | ({entry.dist.name} if entry.dist else set())


def source_of(entry: EntryPoint) -> str:
    """Package, version and module of a plugin."""
    return f"{entry.dist.name} {entry.dist.version} ({entry.value})" if entry.dist else entry.value


def is_own(entry: EntryPoint) -> bool:
    """Whether a plugin ships with nlsolve."""
    return entry.dist is not None and entry.dist.name == PROJECT
