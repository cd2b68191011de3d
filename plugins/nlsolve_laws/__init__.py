"""Constitutive laws μ(ε̄²), one in each file; Bingham's is beside that of Herschel and Bulkley."""

from __future__ import annotations

from collections.abc import Iterable

from nlsolve.plugin import Component, hookimpl
from nlsolve_laws.carreau_yasuda import CarreauYasuda
from nlsolve_laws.cross import Cross
from nlsolve_laws.herschel_bulkley import Bingham, HerschelBulkley
from nlsolve_laws.norton_hoff import NortonHoff
from nlsolve_laws.power_law import PowerLaw
from nlsolve_laws.sellars_tegart import SellarsTegart


@hookimpl
def nlsolve_components() -> Iterable[type[Component]]:
    """The laws of this package."""
    return [PowerLaw, NortonHoff, CarreauYasuda, Cross, HerschelBulkley, Bingham, SellarsTegart]
