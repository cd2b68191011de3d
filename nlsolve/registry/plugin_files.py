"""Plugins without installation: files that a study or --plugin names, and classes that are given from Python."""

from __future__ import annotations

import hashlib
import re
import sys
from collections.abc import Iterable
from importlib.machinery import SOURCE_SUFFIXES
from pathlib import Path
from types import ModuleType

from nlsolve.contracts.component import Component
from nlsolve.registry.classes import CONTRACTS
from nlsolve.registry.installed import hookspecs
from nlsolve.registry.installed.contract_version import unserved
from nlsolve.registry.installed.probing import fault_of_file, module_of_file, undisturbed
from nlsolve.registry.problems import StudyError
from nlsolve.registry.registry import Registry
from nlsolve.registry.rows import sentence_of

DIGEST_LETTERS = 8

Plugin = str | Path | type[Component]
"""A plugin that needs no installation: the path of a file, or a component class."""


def with_files(registry: Registry, paths: Iterable[Path]) -> Registry:
    """A registry that also has the components of these files. Raises StudyError for a file that cannot be used."""
    for path in paths:
        file = path.resolve()
        if file in registry.files:
            continue
        module = load_file(path)
        source = f"{file.stem.replace(' ', '-')} ({path})"
        try:
            registry = registry.with_(_offered_by(module), source, file)
        except Exception as error:  # a stranger's hook may raise anything
            raise StudyError(f"the plugin {path} cannot be registered: {sentence_of(error)}") from error
    return registry


def with_plugins(registry: Registry, plugins: Iterable[Plugin]) -> Registry:
    """A registry that also has these classes, and the components of these files.

    Raises StudyError for a file or a class that cannot be used.
    """
    for plugin in plugins:
        if isinstance(plugin, str | Path):
            registry = with_files(registry, [Path(plugin)])
            continue
        try:
            registry = registry.with_([plugin], getattr(plugin, "__module__", "Python"))
        except TypeError as error:
            raise StudyError(f"the plugin {plugin!r} cannot be registered: {error}") from error
    return registry


def load_file(path: Path) -> ModuleType:
    """The module of a file. Its name follows from the name and the text of the file, so that a file is imported once a
    process until it is edited, and objects of its classes can be sent to a process that has loaded the same file.

    Raises StudyError for a file that cannot be imported, or was written for another contract.
    """
    try:
        text = path.read_bytes()
    except OSError as error:
        raise StudyError(f"the plugin {path} cannot be read: {error.strerror}") from error
    digest = hashlib.sha256(text).hexdigest()[:DIGEST_LETTERS]
    name = f"nlsolve_file_{re.sub(r'[^0-9A-Za-z]', '_', path.stem)}_{digest}"
    if name in sys.modules:
        return sys.modules[name]
    if path.suffix not in SOURCE_SUFFIXES:
        raise StudyError(f"the plugin {path} is no Python file: its name should end with .py")
    reason = unserved(text.decode(errors="replace"))
    if reason:
        raise StudyError(f"the plugin {path} cannot be used: {reason}")
    file = path.resolve()
    fault = fault_of_file(file)
    if fault:
        raise StudyError(f"the plugin {path} cannot be imported: {fault}")
    try:
        with undisturbed():
            return module_of_file(name, file)
    except (Exception, SystemExit) as error:  # a stranger's file may raise anything
        raise StudyError(f"the plugin {path} cannot be imported: {sentence_of(error)}") from error


def _offered_by(module: ModuleType) -> list[type[Component]]:
    """What its hook returns; without a hook, every component class with a kind that the module defines.

    Raises TypeError when there is none.
    """
    hook = getattr(module, hookspecs.nlsolve_components.__name__, None)
    if hook is not None:
        return list(hook())
    contracts = tuple(CONTRACTS.values())
    found = [
        value
        for value in dict.fromkeys(thing for thing in vars(module).values() if isinstance(thing, type))
        if value.__module__ == module.__name__ and issubclass(value, contracts) and "kind" in value.model_fields
    ]
    if not found:
        raise TypeError("it defines no component class with a kind")
    return found
