"""`auto`: SuperLU for small matrices, the fastest installed for larger ones, SuperLU's word on singular ones."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
import scipy.sparse as sp
from nlsolve_linear import auto
from nlsolve_linear.auto import SMALL, Auto
from nlsolve_linear.pardiso import Pardiso
from nlsolve_linear.rslab import Rslab
from nlsolve_linear.superlu import SuperLU

from nlsolve import SolveError, Status
from nlsolve.plugin import Factors, LinearSolver
from nlsolve.solving.tangent import Tangent
from nlsolve.solving.work.ledger import Ledger
from nlsolve.testing import check_linear_solver


def chain(size: int) -> Any:
    """A regular tridiagonal matrix."""
    return sp.diags_array([-1.0, 3.0, -1.5], offsets=[-1, 0, 1], shape=(size, size), format="csr")


def install(monkeypatch: pytest.MonkeyPatch, pardiso: bool, rslab: bool) -> None:
    monkeypatch.setattr(Pardiso, "absent", None if pardiso else "is not here")
    monkeypatch.setattr(Rslab, "absent", None if rslab else "is not here")


def test_it_conforms() -> None:
    check_linear_solver(Auto())


@pytest.mark.parametrize(
    ("pardiso", "rslab", "expected"),
    [
        (True, True, ["pardiso", "rslab", "superlu"]),
        (False, True, ["rslab", "superlu"]),
        (False, False, ["superlu"]),
    ],
)
def test_a_large_matrix_goes_to_the_fastest_that_is_installed(
    pardiso: bool, rslab: bool, expected: list[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    install(monkeypatch, pardiso, rslab)
    assert [linear.called() for linear in Auto().of_size(SMALL + 1)] == expected
    assert [linear.called() for linear in Auto().of_size(SMALL)] == ["superlu"]


@pytest.mark.parametrize("size", [SMALL, SMALL + 1])
def test_no_orderings_are_tried_so_that_counts_do_not_depend_on_what_is_installed(
    size: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    counts = []
    for installed in (True, False):
        install(monkeypatch, pardiso=installed, rslab=installed)
        counts.append(Auto().factorize(chain(size)).attempts)
    assert counts == [1, 1]


class Refusing(LinearSolver):
    """Finds every matrix singular."""

    kind: str = "refusing"
    status: Status = Status.SINGULAR_TANGENT

    def factorize(self, matrix: Any, previous: Factors | None = None) -> Factors:
        raise SolveError(self.status, "no")


def test_where_the_first_finds_a_matrix_singular_the_next_is_asked_and_both_count(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(auto, "FASTEST", (Refusing, SuperLU))
    matrix, rhs = chain(SMALL + 1), np.ones(SMALL + 1)
    factors = Auto().factorize(matrix)
    assert (factors.chosen, factors.attempts) == ("superlu", 2)
    np.testing.assert_allclose(matrix @ factors.solve(rhs), rhs, rtol=1e-12)


def test_superlu_has_the_last_word_on_a_singular_matrix() -> None:
    matrix = chain(SMALL + 1).tolil()
    matrix[7] = 0.0
    with pytest.raises(SolveError, match="SuperLU") as raised:
        Auto().factorize(matrix.tocsr())
    assert raised.value.status is Status.SINGULAR_TANGENT


def test_any_other_failure_is_not_tried_again(monkeypatch: pytest.MonkeyPatch) -> None:
    class Full(Refusing):
        status: Status = Status.OUT_OF_MEMORY

    monkeypatch.setattr(auto, "FASTEST", (Full, SuperLU))
    with pytest.raises(SolveError) as raised:
        Auto().factorize(chain(SMALL + 1))
    assert raised.value.status is Status.OUT_OF_MEMORY


def test_the_row_tells_the_choice() -> None:
    tangent = Tangent(Auto(), None, Ledger())
    assert tangent.facts()["linear_chosen"] is None
    tangent.refresh_if_due(lambda: chain(5))
    assert tangent.facts()["linear_chosen"] == "superlu"
