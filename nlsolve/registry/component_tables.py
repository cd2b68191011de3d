"""A component as a table of fields, which a study may change and which becomes an instance of the same class again."""

from __future__ import annotations

from typing import Any

from nlsolve.contracts.component import Component


class ComponentTable(dict[str, Any]):
    """The fields of a component by name.

    cls : class of the component; it need not be the installed class of its kind.
    """

    def __init__(self, cls: type[Component], fields: dict[str, Any]) -> None:
        super().__init__(fields)
        self.cls = cls


def table_of(component: Component) -> ComponentTable:
    """The fields of a component as a table; a field that is a component itself becomes a table too."""
    fields = {name: getattr(component, name) for name in type(component).model_fields}
    inside = {name: table_of(value) for name, value in fields.items() if isinstance(value, Component)}
    return ComponentTable(type(component), component.model_dump() | inside)


def own_class(table: object) -> type[Component] | None:
    """The class that a table was made from; None for a table whose kind has changed since, and for anything else."""
    if not isinstance(table, ComponentTable):
        return None
    kind = table.cls.model_fields.get("kind")
    return table.cls if kind is None or table.get("kind") == kind.default else None


def class_name(cls: type[Component]) -> str:
    """The full name of a class: module.Class."""
    return f"{cls.__module__}.{cls.__qualname__}"
