"""The contracts that a plugin may serve, and what a class must declare so that a study can ask for it."""

from __future__ import annotations

import inspect
from typing import Any, get_args

from nlsolve.contracts.component import Component
from nlsolve.contracts.continuum.discretizer import Discretizer
from nlsolve.contracts.continuum.law import ConstitutiveLaw
from nlsolve.contracts.linear_solver import LinearSolver
from nlsolve.contracts.nonlinear_solver import NonlinearSolver
from nlsolve.contracts.rules.globalization import Globalization
from nlsolve.contracts.rules.homotopy_form import HomotopyForm
from nlsolve.contracts.rules.operator import IterationOperator
from nlsolve.contracts.rules.predictor import Predictor
from nlsolve.contracts.rules.range_rule import RangeRule
from nlsolve.contracts.rules.refresh import RefreshRule
from nlsolve.contracts.scene import Scene

CONTRACTS: dict[str, type[Component]] = {
    contract.noun: contract
    for contract in (
        Scene,
        ConstitutiveLaw,
        Discretizer,
        LinearSolver,
        NonlinearSolver,
        RefreshRule,
        IterationOperator,
        Predictor,
        Globalization,
        RangeRule,
        HomotopyForm,
    )
}
"""The contracts whose classes a plugin may offer, by noun, in the order of a study file."""


FIRST_PARTY = "nlsolve"
"""The package whose kinds are meant where a study asks for one that other packages offer too."""

QUALIFIED = ":"
"""Stands between a package and a kind of it: `my-package:newton`."""

DISABLE = "NLSOLVE_DISABLE_PLUGINS"
"""Environment variable with the names of plugins, or packages of plugins, not to be imported: `first,second`."""

DISABLED = "disabled"

RENAMED_KINDS = {("scene", "system"): "published"}
"""Kinds of older study files, by noun, and what they are called now."""

QUALIFIED = ":"
"""Stands between a package and a kind of it: `my-package:newton`."""


def checked(cls: Any) -> type[Component]:
    """`cls` when it is a concrete component class of a contract with a literal kind. Raises TypeError otherwise."""
    contracts = tuple(CONTRACTS.values())
    if not (isinstance(cls, type) and issubclass(cls, Component) and issubclass(cls, contracts)):
        raise TypeError(f"{cls!r} is not a subclass of one of {', '.join(c.__name__ for c in contracts)}")
    if inspect.isabstract(cls):
        missing = ", ".join(sorted(cls.__abstractmethods__))
        raise TypeError(f"{cls.__name__} leaves methods of its contract out: {missing}")
    kind = cls.kind_name()
    names = get_args(cls.model_fields["kind"].annotation)
    if names != (kind,):
        raise TypeError(f'{cls.__name__} must declare its name: kind: Literal["name"] = "name"')
    if QUALIFIED in kind:
        raise TypeError(f"{cls.__name__} has the kind {kind!r}: a kind has no {QUALIFIED!r}, which packages end with")
    check_properties(cls)
    return cls


def check_properties(cls: type[Component]) -> None:
    """Raises TypeError where the contract has a property and `cls` a method, or the other way round: whoever reads the
    one would get a function, and whoever calls the other would call a value.
    """
    bases = [base for base in cls.__mro__ if issubclass(base, Component)]
    for name, promised in ((name, thing) for base in bases for name, thing in vars(base).items()):
        given = inspect.getattr_static(cls, name, None)
        if isinstance(promised, property) and inspect.isfunction(given):
            raise TypeError(f"{cls.__name__}.{name} is a method, and should be a property: write @property above it")
        if inspect.isfunction(promised) and isinstance(given, property):
            raise TypeError(f"{cls.__name__}.{name} is a property, and should be a method: leave @property out")
