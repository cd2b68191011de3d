"""The component classes that installed plugins offer, by noun and kind.

A plugin that cannot be imported or registered becomes a row with the reason, and the other plugins work. A kind that
several packages offer is the first-party one; without that, a study asks for one of them by a qualified kind:
`my-package:newton`.
"""

from __future__ import annotations

import os
from collections.abc import Collection, Iterable, Iterator, Mapping
from contextlib import contextmanager
from contextvars import ContextVar
from copy import copy
from difflib import get_close_matches
from functools import cache
from importlib.metadata import EntryPoint
from pathlib import Path
from typing import Annotated, Any, Union

import pluggy
from pydantic import PlainValidator, SerializeAsAny
from pydantic_core import PydanticCustomError

from nlsolve.contracts.component import Component
from nlsolve.registry.classes import CONTRACTS, QUALIFIED, check_properties, checked
from nlsolve.registry.component_tables import ComponentTable, own_class
from nlsolve.registry.installed import hookspecs
from nlsolve.registry.installed.contract_version import text_of, unserved
from nlsolve.registry.installed.entries import installed_plugins, is_own, names_of, source_of
from nlsolve.registry.installed.probing import faults_of, undisturbed
from nlsolve.registry.offers import Offers
from nlsolve.registry.rows import PluginRow, meaning_of, parameters_of, sentence_of

DISABLE = "NLSOLVE_DISABLE_PLUGINS"
"""Environment variable with the names of plugins, or packages of plugins, not to be imported: `first,second`."""

DISABLED = "disabled"

RENAMED_KINDS = {("scene", "system"): "published"}
"""Kinds of older study files, by noun, and what they are called now."""


class Registry(Offers):
    """Component classes by noun and kind, and the plugins that failed, with the reason."""

    def __init__(self) -> None:
        super().__init__()
        self._manager = pluggy.PluginManager(hookspecs.PROJECT)
        self._manager.add_hookspecs(hookspecs)
        self._failures: list[PluginRow] = []
        self._disabled: list[PluginRow] = []
        self.files: tuple[Path, ...] = ()

    @classmethod
    def installed(cls, disabled: Collection[str] = ()) -> Registry:
        """A registry of the plugins in the entry-point group, loaded in the order of their names.

        disabled : names of plugins, or of packages of plugins, that are not imported.
        """
        registry = cls()
        entries = installed_plugins()
        wanted = [entry for entry in entries if names_of(entry).isdisjoint(disabled)]
        faults = faults_of([entry for entry in wanted if not is_own(entry)])
        for entry in entries:
            if entry not in wanted:
                registry._disabled.append(PluginRow("", "", source_of(entry), failure=DISABLED))
            elif entry.value in faults:
                registry._fail(source_of(entry), f"the plugin {entry.name!r} cannot be imported: {faults[entry.value]}")
            else:
                registry.load(entry)
        return registry

    def load(self, entry: EntryPoint) -> None:
        """Import the plugin of one entry point and register it; a failure, or a version of the contract that is not
        served, becomes a row."""
        source = source_of(entry)
        try:
            with undisturbed():
                reason = "" if is_own(entry) else unserved(text_of(entry))
                plugin = None if reason else entry.load()
        except (Exception, SystemExit) as error:  # a stranger's import may raise anything; the rest must still work
            self._fail(source, f"the plugin {entry.name!r} cannot be imported: {sentence_of(error)}")
        else:
            if reason:
                self._fail(source, f"the plugin {entry.name!r} cannot be used: {reason}")
            else:
                self.add(plugin, source)

    def add(self, plugin: object, source: str) -> None:
        """Register a module or object with a `nlsolve_components` hook; a failure becomes a row.

        source : the package that it comes from, and whatever else tells it: "my-package 1.0 (module)".
        """
        try:
            offered = self._offered_by(plugin)
        except Exception as error:  # as above: a stranger's hook
            self._fail(source, f"the plugin cannot be registered: {sentence_of(error)}")
            return
        self.offer(offered, source)

    def with_(self, classes: Iterable[type[Component]], source: str, file: Path | None = None) -> Registry:
        """A registry that has these classes as well, of a file or of none; `files` are all such files.

        Raises TypeError for a class that no study can ask for.
        """
        wider = copy(self)
        wider._set_apart()
        wider.files = self.files if file is None else (*self.files, file)
        wider.offer(classes, source)
        return wider

    def _offered_by(self, plugin: object) -> list[type[Component]]:
        """The checked classes of one plugin. Its hook is called alone, so that a failure concerns no other plugin.

        A plugin that fails is unregistered again. Raises whatever its hook raises, ValueError for a plugin that is
        registered already, and TypeError or pluggy's PluginValidationError for one that does not follow the hook.
        """
        if self._manager.is_registered(plugin):
            raise ValueError("it is registered already")
        try:
            self._manager.register(plugin)
            self._manager.check_pending()  # fails on a marked function that has not the name of a hook
            others = self._manager.get_plugins() - {plugin}
            answers = self._manager.subset_hook_caller(hookspecs.nlsolve_components.__name__, others)()
            if not answers:
                raise TypeError(
                    f"it has no function {hookspecs.nlsolve_components.__name__} marked with @hookimpl "
                    "that returns component classes"
                )
            return [checked(cls) for answer in answers for cls in answer]
        except Exception:
            if self._manager.is_registered(plugin):
                self._manager.unregister(plugin)
            raise

    def _fail(self, source: str, reason: str) -> None:
        self._failures.append(PluginRow("", "", source, failure=reason))

    def complaint(self, noun: str, kind: object) -> str | None:
        """Why this noun and kind have no usable class, in one sentence; None when they have one."""
        classes = self.classes(noun)
        if isinstance(kind, str) and self.class_called(noun, kind) is not None:
            return None
        offers = self._chosen(noun, kind) if isinstance(kind, str) else []
        if len(offers) == 1:
            return f"{noun} {kind!r} {offers[0].cls.absent}"
        if offers:
            both, names = " and ".join(offer.source for offer in offers), sorted({offer.name for offer in offers})
            way = f"ask for {' or '.join(map(repr, names))}" if len(names) > 1 else "uninstall all but one"
            return f"{noun} {kind!r} is offered by {both}: {way}"
        if isinstance(kind, str) and (noun, kind) in RENAMED_KINDS:
            return f"this kind is called {RENAMED_KINDS[noun, kind]!r} now"
        failed = f"; {len(self._failures)} plugin(s) failed, see `nlsolve plugins`" if self._failures else ""
        failed += f"; {len(self._disabled)} plugin(s) disabled" if self._disabled else ""
        if isinstance(kind, str) and QUALIFIED in kind:
            provider, _, bare = kind.rpartition(QUALIFIED)
            others = [offer.name for offer in self._offers.get((noun, bare), [])]
            there = f"it is offered as {', '.join(others)}" if others else f"nothing offers a {noun} of this kind"
            return f"{provider!r} offers no {noun} {bare!r}; {there}{failed}"
        nearest = get_close_matches(str(kind), classes, n=1)
        guess = f"did you mean {nearest[0]!r}? " if nearest else ""
        return f"no such {noun}; {guess}installed: {', '.join(classes) or 'none'}{failed}"

    def known(self, noun: str, value: object) -> object:
        """`value` itself when it is a component of this noun or a table of one.

        Raises PydanticCustomError for anything else.
        """
        if isinstance(value, Component | ComponentTable):
            self._check_class(noun, value.cls if isinstance(value, ComponentTable) else type(value))
        if isinstance(value, Component) or own_class(value) is not None:
            return value
        if isinstance(value, type) and issubclass(value, Component):
            message = "{name} is a class: give an instance of it, such as {name}()"
            raise PydanticCustomError("instance_expected", message, {"name": value.__name__})
        if not isinstance(value, Mapping):
            raise PydanticCustomError(
                "table_expected", 'should be a table with a kind, like { kind = "…" }, or an instance'
            )
        if "kind" not in value:
            kinds = ", ".join(self.classes(noun)) or "none"
            raise PydanticCustomError("kind_missing", "required, and missing; installed: {kinds}", {"kinds": kinds})
        complaint = self.complaint(noun, value["kind"])
        if complaint is not None:
            raise PydanticCustomError("kind_unknown", "{complaint}", {"complaint": complaint})
        return value

    def _check_class(self, noun: str, cls: type[Component]) -> None:
        """Raises PydanticCustomError for a class of another contract or without a kind."""
        told = {"name": cls.__name__, "given": cls.noun, "noun": noun, "kinds": ", ".join(self.classes(noun)) or "none"}
        if not issubclass(cls, CONTRACTS[noun]):
            message = "{name} is a {given}, where a {noun} belongs; installed: {kinds}"
            raise PydanticCustomError("contract_wrong", message, told)
        try:
            cls.kind_name()
            check_properties(cls)
        except TypeError as error:
            raise PydanticCustomError("kind_undeclared", "{reason}", {"reason": str(error)}) from error

    def class_of(self, noun: str, value: object) -> type[Component] | None:
        """The class of a component, or the class that a table names; None when the table names no usable class."""
        if isinstance(value, Component):
            return type(value)
        if (own := own_class(value)) is not None:
            return own
        kind = value.get("kind") if isinstance(value, Mapping) else None
        return self.class_called(noun, kind) if isinstance(kind, str) else None

    def component(self, noun: str, value: object) -> Component:
        """`value` itself when it is a component, of any class, installed or not; the component of a table otherwise.

        Raises PydanticCustomError when there is no such class, ValidationError when a field is wrong.
        """
        known = self.known(noun, value)
        if isinstance(known, Component):
            return known
        cls = self.class_of(noun, known)
        assert cls is not None  # because `known` has found it
        assert isinstance(known, Mapping)  # as above
        if QUALIFIED in str(known.get("kind")):
            known = {**known, "kind": cls.kind_name()}
        return cls.model_validate(known)

    def union(self, noun: str) -> Any:
        """The pydantic type of a section: an instance of any class of this noun, or a table of an installed one."""

        def component(value: object) -> Component:
            return self.component(noun, value)

        members = tuple(self.classes(noun).values()) or (Component,)
        return Annotated[Union[members], PlainValidator(component), SerializeAsAny()]  # noqa: UP007

    def plugins(self) -> list[PluginRow]:
        """A row for every offered component, then a row for every plugin that failed."""
        order = list(CONTRACTS)
        rows = []
        for (noun, kind), offers in sorted(
            self._offers.items(), key=lambda item: (order.index(item[0][0]), item[0][1])
        ):
            for offer in offers:
                name = kind if self._chosen(noun, kind) == [offer] else offer.name
                failure = self.complaint(noun, name)
                rows.append(
                    PluginRow(noun, name, offer.source, parameters_of(offer.cls), failure, meaning_of(offer.cls))
                )
        return rows + self._failures + self._disabled

    @property
    def failures(self) -> tuple[PluginRow, ...]:
        """A row for every plugin that failed."""
        return tuple(self._failures)

    @contextmanager
    def in_use(self) -> Iterator[None]:
        """Let components inside components be looked up in this registry."""
        before = _IN_USE.set(self)
        try:
            yield
        finally:
            _IN_USE.reset(before)


def load_registry() -> Registry:
    """The registry of the installed plugins, without those that the environment variable `DISABLE` names; loaded at
    the first call in a process."""
    return _installed(frozenset(filter(None, os.environ.get(DISABLE, "").split(","))))


@cache
def _installed(disabled: frozenset[str]) -> Registry:
    return Registry.installed(disabled)


_IN_USE: ContextVar[Registry | None] = ContextVar("registry in use", default=None)


def registry_in_use() -> Registry:
    """The registry of the study that is being built; elsewhere that of the installed plugins."""
    return _IN_USE.get() or load_registry()
