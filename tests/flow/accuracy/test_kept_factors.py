"""The factors of one matrix serve the next ones, as far as they are near."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
import scipy.sparse as sp
from nlsolve_linear.lapack import Lapack
from nlsolve_linear.superlu import SuperLU

from nlsolve.flow.accuracy.kept_factors import ACCURATE, POOR, KeptFactors
from nlsolve.plugin import SolveError, Status

UNKNOWNS = 60


def matrix(change: float, seed: int = 0) -> Any:
    """A tridiagonal matrix, and a random change of it."""
    random = np.random.default_rng(seed)
    plain = sp.diags_array([-1.0, 4.0, -1.5], offsets=[-1, 0, 1], shape=(UNKNOWNS, UNKNOWNS))
    return sp.csr_array(plain + change * sp.random_array((UNKNOWNS, UNKNOWNS), density=0.1, rng=random))


RHS = np.cos(np.arange(UNKNOWNS))


def left(a: Any, x: Any) -> float:
    return float(np.linalg.norm(RHS - a @ x) / np.linalg.norm(RHS))


@pytest.mark.parametrize("linear", [Lapack(), SuperLU(ordering="colamd")], ids=str)
def test_the_first_matrix_is_solved_by_its_own_factors(linear: Any) -> None:
    assert left(matrix(0.0), KeptFactors(linear=linear).factorize(matrix(0.0)).solve(RHS)) < 1e-14


def test_a_near_matrix_is_solved_with_the_factors_of_the_first() -> None:
    kept = KeptFactors(linear=Lapack())
    first = kept.factorize(matrix(0.0))
    near = kept.factorize(matrix(0.3), first)
    x = near.solve(RHS)
    assert near.factors is first.factors
    assert 1e-14 < left(matrix(0.3), x) <= ACCURATE


def test_a_far_matrix_is_factorised_and_serves_the_next() -> None:
    kept = KeptFactors(linear=Lapack())
    first = kept.factorize(matrix(0.0))
    far = kept.factorize(matrix(1e3), first)
    assert left(matrix(1e3), far.solve(RHS)) < 1e-10 < POOR
    assert far.factors is not first.factors
    assert kept.factorize(matrix(1e3), far).factors is far.factors


def test_a_singular_matrix_is_refused_as_its_linear_solver_does() -> None:
    with pytest.raises(SolveError) as caught:
        KeptFactors(linear=Lapack()).factorize(sp.csr_array((UNKNOWNS, UNKNOWNS)))
    assert caught.value.status is Status.SINGULAR_TANGENT


def test_superlu_tries_no_orderings_for_one_matrix() -> None:
    assert SuperLU().for_one_matrix().factorize(matrix(0.0)).attempts == 1
    assert SuperLU(ordering="colamd").for_one_matrix().ordering == "colamd"
    assert Lapack().for_one_matrix() == Lapack()
