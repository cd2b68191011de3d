"""μ(ε̄²) : the check of constitutive laws."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from nlsolve.contracts.continuum.law import CONTRACTION, ConstitutiveLaw, stress
from nlsolve.flow.continuation import VALUES, Start
from nlsolve.series import Series
from nlsolve.testing.kit.verdicts import promise
from nlsolve.testing.promises import ORDER, PARTS, check_coefficients, require, same

FAR = np.array([1e-12, 1e-6, 1e6, 1e12])
"""Rates far outside those at which numbers are compared [1/s]."""


def check_law(law: ConstitutiveLaw, rates: Iterable[float] = tuple(10.0 ** np.arange(-1.0, 4.5, 0.5))) -> None:
    """Check μ(ε̄²) at the given ε̄ [1/s]: positive and finite, also far from them; its derivative by seed against
    central differences, to 1e-7; its Taylor coefficients along a path ε̄²(a) against μ on that path. Every name in
    `continued_by` must be a field of the law, which takes the values by which a study begins. Raises AssertionError.
    """
    with promise("continuation", "the law takes the values of the fields in continued_by; a law without goes without"):
        strange = [name for name in law.continued_by if name not in type(law).model_fields]
        require(not strange, f"the law is continued by {strange}, which are none of its fields")
        _check_continuation(law)
    x = np.asarray(tuple(rates)) ** 2
    kept = x.copy()
    with promise("shape", "μ of an array of rates is a real array of its shape: a constant law adds 0 * rate_squared"):
        mu = np.asarray(law.viscosity(x))
        require(mu.shape == x.shape, f"viscosity of shape {mu.shape} for rates of shape {x.shape}")
        require(mu.dtype.kind in "fiu", f"viscosity of {mu.dtype} numbers, which should be real")
    with promise("positive", "μ > 0, and finite, at every rate"):
        bad = np.sqrt(x[~(np.isfinite(mu) & (mu > 0.0))])
        require(not bad.size, f"the viscosity is not a positive finite number at the rates {bad} 1/s")
    with promise("dissipation", "S:ε̇ ≥ 0: the law takes up power"):
        strain = np.random.default_rng(0).standard_normal((3, len(x))) * np.sqrt(x)
        power = CONTRACTION @ (stress(law, strain) * strain)
        require((power >= 0.0).all(), f"the law gives off power, S:ε̇ < 0, at {(power < 0.0).sum()} of {len(x)} rates")
    with promise("series", "μ of a series is a series with the same values: analytic operations only"):
        seeded = law.viscosity(Series.seed(x))
        require(isinstance(seeded, Series), "the viscosity of a series must be a series: use analytic operations only")
        same(seeded.coefficient(0) / mu, 1.0, 1.0, "viscosity on a series over that on an array", 1e-14)
    with promise("derivative", "μ′ by seed is that of central differences, to 1e-7"):
        slope, small = seeded.coefficient(1), 1e-4 * mu / x  # near a maximum of μ its slope vanishes
        differences = [(law.viscosity(x * (1 + h)) - law.viscosity(x * (1 - h))) / (2 * h * x) for h in PARTS]
        off = np.min([np.abs(slope - d) / np.maximum(np.abs(slope), small) for d in differences], axis=0)
        require(off.max() <= 1e-7, f"μ′ by seed is off by {off.max():.1e} at {np.sqrt(x[off.argmax()]):.3g} 1/s")
    with promise("coefficients", f"the first {ORDER} Taylor coefficients of μ along a path are those of its values"):
        path = Series(x)
        values = law.viscosity(path)
        for j in range(1, ORDER + 1):
            path.append(x * np.cos(np.arange(len(x)) + j) / 2.0**j)
        coefficients = [values.coefficient(j) for j in range(ORDER + 1)]
        check_coefficients(lambda a: law.viscosity(path.sum(a)), coefficients, "viscosity")
    with promise("far rates", "μ is a number ≥ 0, perhaps infinite, at rest and from 1e-12 to 1e12 1/s"):
        with np.errstate(all="ignore"):
            far = np.asarray(law.viscosity(np.concatenate([[0.0], FAR**2])))
        bad = np.concatenate([[0.0], FAR])[~(far >= 0.0)]
        require(not bad.size, f"the viscosity is not a number ≥ 0 at the rates {bad} 1/s")
    with promise("no mutation", "the rates are not changed, and μ is the same each time"):
        again = np.asarray(law.viscosity(x))
        require(np.array_equal(x, kept), "the law changed the rates it was given")
        require(np.array_equal(again, mu), "the viscosity is another when it is asked for again")


def _check_continuation(law: ConstitutiveLaw) -> None:
    """A study begins by the values of `Start`; a law that no field continues begins at rest, with `values = []`."""
    for by in law.continued_by:
        try:
            law.continuation(by, VALUES)
        except ValueError as error:  # a ValidationError is one
            told = str(error).replace("\n", "; ")
            raise AssertionError(f"continued by {by!r}, the law refuses {VALUES}: {told}") from error
    if not law.continued_by:
        Start(values=()).stages(law)
