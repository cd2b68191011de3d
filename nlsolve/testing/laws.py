"""μ(ε̄²) : the check of constitutive laws."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from nlsolve.contracts.continuum.law import ConstitutiveLaw
from nlsolve.series import Series
from nlsolve.testing.promises import ORDER, PARTS, check_coefficients, require, same


def check_law(law: ConstitutiveLaw, rates: Iterable[float] = tuple(10.0 ** np.arange(-1.0, 4.5, 0.5))) -> None:
    """Check μ(ε̄²) at the given ε̄ [1/s]: positive and finite; its derivative by seed against central differences, to
    1e-7; its Taylor coefficients along a path ε̄²(a) against μ on that path. Every name in `continued_by` must be a
    field of the law. Raises AssertionError.
    """
    strange = [name for name in law.continued_by if name not in type(law).model_fields]
    require(not strange, f"the law is continued by {strange}, which are none of its fields")
    x = np.asarray(tuple(rates)) ** 2
    mu = np.asarray(law.viscosity(x))
    require(mu.shape == x.shape, f"viscosity of shape {mu.shape} for rates of shape {x.shape}")
    bad = np.sqrt(x[~(np.isfinite(mu) & (mu > 0.0))])
    require(not bad.size, f"the viscosity is not a positive finite number at the rates {bad} 1/s")
    seeded = law.viscosity(Series.seed(x))
    require(isinstance(seeded, Series), "the viscosity of a series must be a series: use analytic operations only")
    same(seeded.coefficient(0) / mu, 1.0, 1.0, "viscosity on a series over that on an array", 1e-14)
    slope, small = seeded.coefficient(1), 1e-4 * mu / x  # near a maximum of μ its slope vanishes
    differences = [(law.viscosity(x * (1 + h)) - law.viscosity(x * (1 - h))) / (2 * h * x) for h in PARTS]
    off = np.min([np.abs(slope - d) / np.maximum(np.abs(slope), small) for d in differences], axis=0)
    require(off.max() <= 1e-7, f"μ′ by seed is off by {off.max():.1e} at {np.sqrt(x[off.argmax()]):.3g} 1/s")
    path = Series(x)
    values = law.viscosity(path)
    for j in range(1, ORDER + 1):
        path.append(x * np.cos(np.arange(len(x)) + j) / 2.0**j)
    coefficients = [values.coefficient(j) for j in range(ORDER + 1)]
    check_coefficients(lambda a: law.viscosity(path.sum(a)), coefficients, "viscosity")
