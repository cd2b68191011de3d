"""Components inside components: `solver = { kind = "newton", globalization = { kind = "cubic" } }`.

A field of type `Globalized` takes any installed globalisation, a stranger's too. The kind is looked up when a value is
validated, because plugins are still being imported when the field is declared. The default of such a field is a table.
Where the components seldom have fields of their own, `range = "ratio"` is short for `range = { kind = "ratio" }`.
"""

from __future__ import annotations

from typing import Annotated, Any

from pydantic import BeforeValidator, SerializeAsAny, WithJsonSchema

from nlsolve.contracts.component import Component
from nlsolve.contracts.continuum.discretizer import Discretizer
from nlsolve.contracts.nonlinear_solver import NonlinearSolver
from nlsolve.contracts.rules.globalization import Globalization
from nlsolve.contracts.rules.homotopy_form import HomotopyForm
from nlsolve.contracts.rules.range_rule import RangeRule
from nlsolve.contracts.rules.refresh import RefreshRule
from nlsolve.registry.registry import registry_in_use

CONTRACT, BY_NAME = "x-contract", "x-by-name"
"""Keys of a schema that stands for all kinds of a contract, and whether a kind alone may be written."""


def installed(contract: type[Component], by_name: bool = False) -> BeforeValidator:
    """A validator that turns a table with a kind into a component of this contract, and reports mistakes in place.

    by_name : whether a string is taken as well, for the table with that kind alone.
    """

    def component(value: Any) -> Component:
        table = {"kind": value} if by_name and isinstance(value, str) else value
        return registry_in_use().component(contract.noun, table)

    return BeforeValidator(component)


def described(contract: type[Component], by_name: bool = False) -> WithJsonSchema:
    """What the schema of a study says of a field with any component of this contract."""
    return WithJsonSchema({CONTRACT: contract.noun, BY_NAME: by_name})


Globalized = Annotated[SerializeAsAny[Globalization], installed(Globalization), described(Globalization)]
"""The type of a field that holds a globalisation."""

AnySolver = Annotated[SerializeAsAny[NonlinearSolver], installed(NonlinearSolver), described(NonlinearSolver)]
"""The type of a field that holds a nonlinear solver."""

AnyRefresh = Annotated[SerializeAsAny[RefreshRule], installed(RefreshRule), described(RefreshRule)]
"""The type of a field that holds a refresh rule."""

AnyRange = Annotated[
    SerializeAsAny[RangeRule],
    installed(RangeRule, by_name=True),
    described(RangeRule, by_name=True),
]
"""The type of a field that holds a range rule, by its table or its name."""

AnyForm = Annotated[
    SerializeAsAny[HomotopyForm],
    installed(HomotopyForm, by_name=True),
    described(HomotopyForm, by_name=True),
]
"""The type of a field that holds a homotopy form, by its table or its name."""

AnyDiscretizer = Annotated[SerializeAsAny[Discretizer], installed(Discretizer), described(Discretizer)]
"""The type of a field that holds a discretizer."""
