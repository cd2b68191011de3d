"""Components inside components: `solver = { kind = "newton", globalization = { kind = "cubic" } }`.

A field of type `Globalized` takes any installed globalisation, a stranger's too: its kind is looked up when a value
arrives, for plugins are still being imported when the field is declared. The default of such a field is a table.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any

from pydantic import BeforeValidator, SerializeAsAny
from pydantic_core import PydanticCustomError

from nlsolve.component import Component
from nlsolve.globalization import Globalization
from nlsolve.registry import load_registry


def installed(contract: type[Component]) -> BeforeValidator:
    """A table with a kind -> the installed component of this contract; what is wrong is told in its own place."""

    def component(value: Any) -> Any:
        if not isinstance(value, Mapping):
            return value
        registry, kind = load_registry(), value.get("kind")
        complaint = registry.complaint(contract.noun, kind)
        if kind is None:
            kinds = ", ".join(registry.classes(contract.noun)) or "none"
            raise PydanticCustomError("kind_missing", "required, and missing; installed: {kinds}", {"kinds": kinds})
        if complaint is not None:
            raise PydanticCustomError("kind_unknown", "{complaint}", {"complaint": complaint})
        return registry.classes(contract.noun)[kind].model_validate(value)

    return BeforeValidator(component)


Globalized = Annotated[SerializeAsAny[Globalization], installed(Globalization)]
"""The type of a field that holds a globalisation."""
