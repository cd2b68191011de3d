"""seconds = Σ_kind n_kind c_kind : what a method's work costs, by counts and measured unit costs."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any, Self

PREFIX = "unit."
"""Before the name of a unit cost in `runs`."""


COUNTS = (
    "residuals",
    "expansions",
    "jacobians",
    "matrix_products",
    "factorizations",
    "triangular_solves",
    "series_orders",
    "series_terms",
)
"""Columns of `runs` that the unit costs are for."""


@dataclass(frozen=True)
class UnitCosts:
    """Seconds of one piece of work of each kind; a Taylor coefficient of order j: series_order + j series_term."""

    residual: float
    expansion: float
    jacobian: float
    matrix_product: float
    factorization: float
    triangular_solve: float
    series_order: float
    series_term: float

    @property
    def ratio(self) -> float:
        """ρ = factorisation / triangular solve."""
        return self.factorization / self.triangular_solve

    def predict(self, counts: Mapping[str, float]) -> float:
        """Seconds of the work counted under the names of `COUNTS`; a name that is absent counts 0."""
        n = {name: counts.get(name, 0.0) for name in COUNTS}
        return (
            (n["residuals"] - n["expansions"]) * self.residual
            + n["expansions"] * self.expansion
            + n["jacobians"] * self.jacobian
            + n["matrix_products"] * self.matrix_product
            + n["factorizations"] * self.factorization
            + n["triangular_solves"] * self.triangular_solve
            + n["series_orders"] * self.series_order
            + n["series_terms"] * self.series_term
        )

    def columns(self) -> dict[str, float]:
        """The unit costs as columns of `runs`."""
        return {PREFIX + kind: seconds for kind, seconds in asdict(self).items()}

    @classmethod
    def of_columns(cls, run: Mapping[str, Any]) -> Self:
        """The unit costs in the columns of a row of `runs`."""
        return cls(**{kind: float(run[PREFIX + kind]) for kind in cls.__dataclass_fields__})
