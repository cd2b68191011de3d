"""Components inside components: `solver = { kind = "newton", globalization = { kind = "cubic" } }`.

A field of type `Globalized` takes any installed globalisation, a stranger's too. The kind is looked up when a value is
validated, because plugins are still being imported when the field is declared. The default of such a field is a table.
"""

from __future__ import annotations

from typing import Annotated, Any

from pydantic import BeforeValidator, SerializeAsAny

from nlsolve.contracts.component import Component
from nlsolve.contracts.continuum.discretizer import Discretizer
from nlsolve.contracts.nonlinear_solver import NonlinearSolver
from nlsolve.contracts.rules.globalization import Globalization
from nlsolve.registry.registry import load_registry


def installed(contract: type[Component]) -> BeforeValidator:
    """A validator that turns a table with a kind into a component of this contract, and reports mistakes in place."""

    def component(value: Any) -> Component:
        return load_registry().component(contract.noun, value)

    return BeforeValidator(component)


Globalized = Annotated[SerializeAsAny[Globalization], installed(Globalization)]
"""The type of a field that holds a globalisation."""

AnySolver = Annotated[SerializeAsAny[NonlinearSolver], installed(NonlinearSolver)]
"""The type of a field that holds a nonlinear solver."""

AnyDiscretizer = Annotated[SerializeAsAny[Discretizer], installed(Discretizer)]
"""The type of a field that holds a discretizer."""
