"""Linear solvers: each keeps the contract, all agree, and what each is proud of or fails at is what it says."""

from __future__ import annotations

import importlib
import sys
from collections import Counter
from typing import Any

import linear as benchmark
import numpy as np
import pytest
import scipy.linalg
import scipy.sparse as sp
import scipy.sparse.linalg
from cases import near, run, spin_flow
from fakes import registry_of
from nlsolve_linear import pardiso as nlsolve_pardiso
from nlsolve_linear import rslab as nlsolve_rslab
from nlsolve_linear.equilibrium import equilibrated, even_by_diagonal, is_symmetric
from nlsolve_linear.ilu_gmres import IluGmres
from nlsolve_linear.lapack import LARGEST, Lapack
from nlsolve_linear.pardiso import FEW, Pardiso
from nlsolve_linear.rslab import Rslab
from nlsolve_linear.superlu import SuperLU
from nlsolve_rules.refresh import EveryIteration, Never
from nlsolve_solvers import Newton
from nlsolve_solvers.modified_newton import ModifiedNewton

from nlsolve import SolveError, Status
from nlsolve.plugin import Factors, LinearSolver
from nlsolve.solving.stopping import StoppingTest
from nlsolve.solving.tangent import Tangent
from nlsolve.solving.work.ledger import Ledger
from nlsolve.testing import check_linear_solver
from nlsolve.testing.toy_problem import ToyProblem

needs_rslab = pytest.mark.skipif(
    nlsolve_rslab.rslab is None, reason="rslab is not installed: pip install 'nlsolve[rslab]'"
)
needs_pardiso = pytest.mark.skipif(
    nlsolve_pardiso.mkl is None, reason="PARDISO is not installed: pip install 'nlsolve[pardiso]'"
)
LINEARS: list[Any] = [
    Lapack(),
    Lapack(refinement=1),
    IluGmres(),
    IluGmres(drop_tolerance=0.0, refinement=1),
    pytest.param(Rslab(), marks=needs_rslab),
    pytest.param(Rslab(symmetric="never", refinement=1), marks=needs_rslab),
    pytest.param(Pardiso(), marks=needs_pardiso),
    pytest.param(Pardiso(symmetric="never", refinement=1), marks=needs_pardiso),
]
START = ToyProblem.solution + 0.5 * np.cos(np.arange(12.0))


def tangent(form: str = "strong") -> Any:
    """A tangent of a flow of 200 nodes or so."""
    return benchmark.tangents({"kind": "mls", "form": form}, 0.75)[0]


def refusal(work: Any) -> SolveError:
    with pytest.raises(SolveError) as caught:
        work()
    return caught.value


class TestEveryone:
    @pytest.mark.parametrize("linear", LINEARS, ids=str)
    def test_keeps_the_contract(self, linear: LinearSolver) -> None:
        check_linear_solver(linear)

    @pytest.mark.parametrize("linear", LINEARS, ids=str)
    @pytest.mark.parametrize("form", ["strong", "conservative"])
    def test_solves_with_the_tangent_of_a_flow_as_superlu_does(self, linear: LinearSolver, form: str) -> None:
        matrix = tangent(form)
        rhs = np.cos(np.arange(matrix.shape[0]))
        expected = SuperLU().factorize(matrix).solve(rhs)
        np.testing.assert_allclose(
            linear.factorize(matrix).solve(rhs), expected, rtol=0, atol=1e-7 * np.abs(expected).max()
        )

    @pytest.mark.parametrize("linear", LINEARS, ids=str)
    def test_the_same_matrix_gives_the_same_bits(self, linear: LinearSolver) -> None:
        matrix = tangent()
        rhs = np.cos(np.arange(matrix.shape[0]))
        first = linear.factorize(matrix)
        np.testing.assert_array_equal(first.solve(rhs), linear.factorize(matrix, first).solve(rhs))

    @pytest.mark.parametrize("linear", LINEARS, ids=str)
    def test_newton_takes_the_same_iterations(self, linear: LinearSolver) -> None:
        flow = spin_flow(0.5)
        (outcome, _), (expected, _) = (
            run(flow, Newton(), EveryIteration(), near(flow, 0.7), each) for each in (linear, SuperLU())
        )
        assert outcome.status is Status.CONVERGED
        assert len(outcome.rows) == len(expected.rows)
        np.testing.assert_allclose(outcome.state, expected.state, rtol=0, atol=1e-8 * np.abs(expected.state).max())

    @pytest.mark.parametrize("linear", [Lapack(), SuperLU(), pytest.param(Rslab(), marks=needs_rslab)], ids=str)
    def test_the_condition_is_estimated_within_a_small_factor(self, linear: LinearSolver) -> None:
        """Hager's estimate is a lower bound, seldom less than a third."""
        matrix = tangent()
        exact = np.linalg.cond(matrix.toarray(), 1)
        estimate = linear.factorize(matrix).condition()
        assert estimate is not None
        assert exact / 10 <= estimate <= exact * (1 + 1e-6)

    @pytest.mark.parametrize(
        "linear",
        [
            Lapack(),
            SuperLU(),
            pytest.param(Rslab(), marks=needs_rslab),
            pytest.param(Pardiso(), marks=needs_pardiso),
        ],
        ids=str,
    )
    @pytest.mark.parametrize("seed", range(3))
    def test_equations_and_unknowns_may_have_any_unit(self, linear: LinearSolver, seed: int) -> None:
        """A matrix is not singular because its rows and columns have sizes of their own."""
        random = np.random.default_rng(seed)
        matrix = random.standard_normal((12, 12)) + 4.0 * np.eye(12)
        rows, columns = 2.0 ** random.integers(-60, 61, (2, 12))
        solution = random.standard_normal(12)
        factors = linear.factorize(sp.csr_array(rows[:, None] * matrix * columns))
        np.testing.assert_allclose(columns * factors.solve(rows * (matrix @ solution)), solution, rtol=1e-9)

    def test_an_iteration_estimates_no_condition(self) -> None:
        assert IluGmres().factorize(tangent()).condition() is None


class Careless(Lapack):
    """Breaks one promise of the contract."""

    breaks: str

    def factorize(self, matrix: Any, previous: Any = None) -> Any:
        if self.breaks == "non-finite":
            matrix = sp.csr_array(np.nan_to_num(matrix.toarray(), posinf=1.0))
        if self.breaks == "singular":
            matrix = matrix + 1e-3 * sp.eye_array(60)
        factors = super().factorize(matrix, previous)
        if self.breaks == "solves":
            factors.solves = 0
        if self.breaks == "products":
            factors.solves = 3
        if self.breaks == "lent" and previous is not None:
            previous._factors = factors._factors
        return factors


@pytest.mark.parametrize(
    ("breaks", "sentence"),
    [
        ("non-finite", "a matrix with nan was factorised"),
        ("singular", "A x against b|without a word"),
        ("solves", "every pair of triangular solves"),
        ("products", "follows a product"),
        ("lent", "by factors that were lent since"),
    ],
)
def test_the_check_of_linear_solvers_can_fail(breaks: str, sentence: str) -> None:
    with pytest.raises(AssertionError, match=sentence):
        check_linear_solver(Careless(breaks=breaks))


class TestDense:
    def test_stores_the_square(self) -> None:
        factors = Lapack().factorize(tangent())
        assert factors.fill == tangent().shape[0] ** 2
        assert factors.ordering == "dense"

    def test_a_zero_pivot_is_named(self) -> None:
        error = refusal(lambda: Lapack().factorize(sp.csr_array([[1.0, 2.0], [2.0, 4.0]])))
        assert error.status is Status.SINGULAR_TANGENT
        assert str(error) == "LAPACK: pivot 2 of 2 is exactly zero"

    def test_a_matrix_without_a_zero_pivot_is_refused_by_its_condition(self) -> None:
        """Hilbert's matrix of order 14: condition 1e18 and more."""
        error = refusal(lambda: Lapack().factorize(sp.csr_array(scipy.linalg.hilbert(14))))
        assert error.status is Status.SINGULAR_TANGENT
        assert "reciprocal condition number" in str(error)

    def test_what_would_fill_the_memory_is_refused(self) -> None:
        error = refusal(lambda: Lapack().factorize(sp.eye_array(LARGEST + 1, format="csr")))
        assert error.status is Status.NOT_APPLICABLE
        assert "20001 unknowns take 3 GB: choose a sparse linear solver" in str(error)


class TestLentOrder:
    """Columns are ordered once for a pattern, where ordering them is what costs."""

    @pytest.fixture
    def specifications(self, monkeypatch: pytest.MonkeyPatch) -> list[str]:
        seen, splu = list[str](), scipy.sparse.linalg.splu
        monkeypatch.setattr(scipy.sparse.linalg, "splu", lambda *a, **k: seen.append(k["permc_spec"]) or splu(*a, **k))
        return seen

    @pytest.mark.parametrize("ordering", ["mmd-ata", "colamd"])
    def test_the_order_lent_gives_the_same_factors_without_ordering(
        self, ordering: Any, specifications: list[str]
    ) -> None:
        first, following = benchmark.tangents({"kind": "mls"}, 0.75)
        linear = SuperLU(ordering=ordering)
        lent = linear.factorize(first)
        factors = linear.factorize(following, linear.factorize(first, lent))
        alone = linear.factorize(following)
        own = ordering.replace("-", "_").upper()
        assert specifications == [own, "NATURAL", "NATURAL", own]
        assert factors.fill == alone.fill
        assert factors.ordering == alone.ordering == ordering
        rhs = np.cos(np.arange(first.shape[0]))
        np.testing.assert_allclose(factors.solve(rhs), alone.solve(rhs), rtol=1e-9)
        assert factors.condition() == pytest.approx(alone.condition(), rel=1e-9)

    def test_another_pattern_is_ordered_anew(self, specifications: list[str]) -> None:
        linear = SuperLU(ordering="colamd")
        linear.factorize(tangent("conservative"), linear.factorize(tangent()))
        assert specifications == ["COLAMD", "COLAMD"]

    def test_an_ordering_that_costs_nothing_is_found_anew(self, specifications: list[str]) -> None:
        linear = SuperLU(ordering="mmd-at-plus-a")
        linear.factorize(tangent(), linear.factorize(tangent()))
        assert specifications == ["MMD_AT_PLUS_A", "MMD_AT_PLUS_A"]

    def test_auto_keeps_the_ordering_that_was_settled_on_and_its_order(self, specifications: list[str]) -> None:
        lent = SuperLU(ordering="colamd").factorize(tangent())
        factors = SuperLU().factorize(tangent(), lent)
        assert specifications == ["COLAMD", "NATURAL"]
        assert (factors.ordering, factors.attempts) == ("colamd", 1)

    def test_factors_of_a_stranger_lend_nothing(self) -> None:
        assert SuperLU().factorize(tangent(), Lapack().factorize(tangent())).attempts == 3


class TestWeakPivoting:
    """Diagonals of 0.003 pass as pivots of `mmd-at-plus-a` (threshold 0.001): elements grow, digits are lost."""

    matrix = sp.random_array((150, 150), density=0.2, rng=np.random.default_rng(0), format="csr")
    matrix = (matrix + sp.diags_array(np.full(150, 3e-3))).tocsr()
    rhs = np.ones(150)

    def left(self, linear: LinearSolver) -> tuple[float, Ledger]:
        ledger = Ledger()
        kept = Tangent(linear, None, ledger)
        kept.refresh_if_due(lambda: self.matrix)
        x = kept.solve(self.rhs)
        size = np.linalg.norm(abs(self.matrix) @ np.abs(x) + self.rhs)
        return float(np.linalg.norm(self.rhs - self.matrix @ x) / size), ledger

    @pytest.mark.parametrize(
        "weak", [SuperLU(ordering="mmd-at-plus-a"), pytest.param(Rslab(symmetric="never"), marks=needs_rslab)], ids=str
    )
    def test_one_step_of_refinement_repairs_it(self, weak: LinearSolver) -> None:
        lost, _ = self.left(weak)
        repaired, ledger = self.left(weak.with_(refinement=1))
        full, _ = self.left(SuperLU(ordering="mmd-ata"))
        assert lost > 1e3 * full
        assert repaired < full < 1e-15
        assert ledger.counts["triangular_solve"] == 2
        assert ledger.counts["matrix_product"] == 1


class Watched:
    """Incomplete factors that count their own use."""

    def __init__(self, factors: Any, counts: Counter[str]) -> None:
        self._factors, self._counts, self.nnz = factors, counts, factors.nnz

    def solve(self, rhs: Any) -> Any:
        self._counts["solves"] += 1
        return self._factors.solve(rhs)


class TestIncomplete:
    @pytest.fixture
    def seen(self, monkeypatch: pytest.MonkeyPatch) -> Counter[str]:
        counts, spilu = Counter[str](), scipy.sparse.linalg.spilu
        monkeypatch.setattr(scipy.sparse.linalg, "spilu", lambda *a, **k: Watched(spilu(*a, **k), counts))
        return counts

    def test_every_solve_with_the_incomplete_factors_is_in_the_ledger(self, seen: Counter[str]) -> None:
        flow = spin_flow(0.5)
        outcome, ledger = run(flow, ModifiedNewton(), Never(), near(flow, 0.7), IluGmres(drop_tolerance=1e-2))
        k = len(outcome.rows) - 1
        assert outcome.status is Status.CONVERGED
        assert ledger.counts["factorization"] == 1
        assert ledger.counts["triangular_solve"] == seen["solves"] > 5 * k
        assert ledger.counts["matrix_product"] >= ledger.counts["triangular_solve"] - 2 * k

    def test_reaches_the_tolerance_asked_for_and_pays_less_for_less(self) -> None:
        matrix = tangent()
        rhs = np.cos(np.arange(matrix.shape[0]))
        solves = []
        for tolerance in (1e-3, 1e-6, 1e-10):
            factors = IluGmres(drop_tolerance=1e-2, tolerance=tolerance).factorize(matrix)
            x = factors.solve(rhs)
            assert np.linalg.norm(rhs - matrix @ x) <= tolerance * np.linalg.norm(rhs)
            solves.append(factors.solves)
        assert solves == sorted(set(solves))

    def test_incomplete_factors_are_smaller(self) -> None:
        matrix = tangent()
        assert IluGmres(drop_tolerance=1e-2).factorize(matrix).fill < 0.6 * SuperLU().factorize(matrix).fill

    def test_what_is_not_reached_is_a_status_with_a_way_out_and_its_work_is_counted(self, seen: Counter[str]) -> None:
        flow = spin_flow(0.5)
        linear = IluGmres(drop_tolerance=0.5, dimension=2, restarts=1)
        outcome, ledger = run(flow, Newton(), EveryIteration(), near(flow, 0.7), linear)
        assert outcome.status is Status.UNSOLVED_TANGENT
        assert "of the right-hand side after" in outcome.detail
        assert "lower drop_tolerance, raise fill_factor or dimension, or choose a direct solver" in outcome.detail
        assert ledger.counts["triangular_solve"] == seen["solves"] > 4

    def test_a_pivot_that_vanishes_is_a_singular_tangent(self) -> None:
        error = refusal(lambda: IluGmres().factorize(sp.csr_array([[1.0, 0.0], [1.0, 0.0]])).solve(np.ones(2)))
        assert error.status in (Status.SINGULAR_TANGENT, Status.UNSOLVED_TANGENT)


class TestRslab:
    @pytest.fixture
    def analyses(self, monkeypatch: pytest.MonkeyPatch) -> list[str]:
        paths, analyze = list[str](), nlsolve_rslab.rslab.analyze
        monkeypatch.setattr(nlsolve_rslab.rslab, "analyze", lambda *a, **k: paths.append(k["path"]) or analyze(*a, **k))
        return paths

    @needs_rslab
    def test_a_like_pattern_is_analysed_once(self, analyses: list[str]) -> None:
        first, following = benchmark.tangents({"kind": "mls"}, 0.75)
        factors: Factors | None = None
        for matrix in (first, following, first):
            factors = Rslab().factorize(matrix, factors)
        assert analyses == ["lu"]
        Rslab().factorize(tangent("conservative"), factors)
        assert analyses == ["lu", "ldlt"]
        Rslab().factorize(first, SuperLU().factorize(first))  # factors of a stranger lend nothing
        assert analyses == ["lu", "ldlt", "lu"]

    @needs_rslab
    def test_a_symmetric_tangent_needs_half_the_entries(self) -> None:
        matrix = tangent("conservative")
        symmetric, general = (Rslab(symmetric=how).factorize(matrix) for how in ("detect", "never"))
        assert symmetric.path == "ldlt"
        assert general.path == "lu"
        assert symmetric.fill < 0.6 * general.fill

    @needs_rslab
    def test_a_matrix_with_a_symmetric_pattern_alone_is_not_taken_for_symmetric(self) -> None:
        matrix = tangent("conservative")
        matrix[0, 1] += 1e-9 * abs(matrix).max()
        factors = Rslab().factorize(matrix)
        assert factors.path == "lu"
        rhs = np.ones(matrix.shape[0])
        assert np.linalg.norm(rhs - matrix @ factors.solve(rhs)) < 1e-12 * np.linalg.norm(rhs)

    @needs_rslab
    def test_what_is_factorised_is_left_as_it_was(self) -> None:
        matrix = sp.csc_array(tangent())
        matrix.indices[:2] = matrix.indices[1::-1]  # unsorted: rslab wants sorted columns
        matrix.data[:2] = matrix.data[1::-1]
        matrix.has_sorted_indices = False
        kept = matrix.indices.copy(), matrix.data.copy()
        Rslab().factorize(matrix)
        np.testing.assert_array_equal(matrix.indices, kept[0])
        np.testing.assert_array_equal(matrix.data, kept[1])

    @needs_rslab
    def test_nothing_is_said_on_standard_error(self, capfd: pytest.CaptureFixture[str]) -> None:
        error = refusal(lambda: Rslab().factorize(sp.csr_array(np.diag([1.0, 0.0, 2.0]))))
        assert error.status is Status.SINGULAR_TANGENT
        assert str(error).startswith("rslab: ")
        assert capfd.readouterr().err == ""

    def test_without_the_library_its_kind_is_refused_in_a_sentence_and_the_rest_works(
        self, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        monkeypatch.setitem(sys.modules, "rslab", None)
        monkeypatch.delitem(sys.modules, "nlsolve_linear.rslab")
        plugin = importlib.import_module("nlsolve_linear.rslab")
        registry = registry_of(plugin.Rslab, Lapack)
        sentence = "linear 'rslab' needs the library rslab: pip install 'nlsolve[rslab]'"
        assert registry.complaint("linear", "rslab") == sentence
        assert list(registry.classes("linear")) == ["lapack"]
        assert [(row.kind, row.failure) for row in registry.plugins()] == [("lapack", None), ("rslab", sentence)]
        error = refusal(lambda: plugin.Rslab().factorize(tangent()))
        assert error.status is Status.NOT_APPLICABLE
        assert str(error) == "the linear solver 'rslab' needs the library rslab: pip install 'nlsolve[rslab]'"


class TestBenchmark:
    def test_a_row_a_form_and_solver_with_ratios_of_one_run(self) -> None:
        frame = benchmark.measure(0.75, 1)
        assert set(frame["form"]) == set(benchmark.FORMS)
        assert (frame["residual"] < 1e-9).all()
        base = frame[frame["linear"] == benchmark.BASE]
        assert (base[["factor/superlu's", "solve/superlu's"]] == 1.0).all(axis=None)
        assert (frame.loc[frame["linear"] == "ilu-gmres", "solves"] > 1).all()
        assert (frame.loc[frame["linear"] != "ilu-gmres", "solves"] == 1).all()

    def test_a_failure_is_a_row_with_a_sentence(self) -> None:
        first, following = benchmark.tangents({"kind": "mls"}, 0.75)
        failed = benchmark.row(IluGmres(drop_tolerance=0.5, dimension=1, restarts=0), first, following, 1)
        assert list(failed) == ["failure"]
        assert "GMRES left" in failed["failure"]


def test_a_loose_linear_solver_is_answered_for_by_the_outside_test() -> None:
    """Inexact solves slow modified Newton down; they do not let it stop earlier."""
    flow = spin_flow(0.5)
    stop = StoppingTest(tolerance=1e-9)
    loose, _ = run(flow, ModifiedNewton(), Never(), near(flow, 0.7), IluGmres(tolerance=0.3), stop)
    tight, _ = run(flow, ModifiedNewton(), Never(), near(flow, 0.7), IluGmres(), stop)
    assert loose.status is tight.status is Status.CONVERGED
    assert len(loose.rows) >= len(tight.rows)
    assert loose.residual_norm <= 1e-9 * flow.scale(near(flow, 0.7))


@pytest.mark.parametrize("error", [MemoryError(), RuntimeError("SUPERLU_MALLOC fails for buf in intCalloc()")])
def test_factors_without_memory_are_no_singular_tangent(error: Exception, monkeypatch: pytest.MonkeyPatch) -> None:
    def fails(*_: Any, **__: Any) -> None:
        raise error

    monkeypatch.setattr(scipy.sparse.linalg, "splu", fails)
    refused = refusal(lambda: SuperLU(ordering="colamd").factorize(tangent()))
    assert refused.status is Status.OUT_OF_MEMORY
    assert "SuperLU" in refused.detail


@needs_pardiso
class TestPardiso:
    def test_a_conservative_tangent_has_half_the_entries(self) -> None:
        symmetric, general = (
            Pardiso(symmetric=kind).factorize(tangent("conservative")) for kind in ("detect", "never")
        )
        assert (symmetric.ordering, general.ordering) == ("minimum degree, llt", "minimum degree, lu")
        assert symmetric.fill < 0.7 * general.fill

    def test_a_matrix_that_is_not_positive_definite_has_factors_with_pivots(self) -> None:
        """What precedes it may have been definite, and then asks for its own once more."""
        definite = sp.csr_array(np.array([[2.0, 1.0, 1.0], [1.0, 3.0, 1.0], [1.0, 1.0, 2.0]]))
        other = definite.copy()
        other.data[[1, 3]] = 4.0
        rhs = np.arange(3.0)
        first = Pardiso().factorize(definite)
        second = Pardiso().factorize(other, first)
        third = Pardiso().factorize(definite, second)
        assert [factors.ordering for factors in (first, second, third)] == [
            "minimum degree, llt",
            "minimum degree, ldlt",
            "minimum degree, ldlt",
        ]
        assert [factors.attempts for factors in (first, second, third)] == [1, 2, 1]
        for factors, matrix in ((first, definite), (second, other), (third, definite)):
            np.testing.assert_allclose(matrix @ factors.solve(rhs), rhs, atol=1e-14)

    @pytest.mark.parametrize("symmetric", [True, False])
    def test_a_matrix_without_a_null_vector_of_its_own_is_refused(self, symmetric: bool) -> None:
        """A Laplacian without a wall: each row adds up to zero, and PARDISO perturbs the last pivot."""
        off = np.ones(39)
        laplacian = sp.diags_array([-off, np.r_[1.0, 2.0 * off[1:], 1.0], -off], offsets=[-1, 0, 1], format="csr")
        if not symmetric:
            laplacian = (sp.diags_array(1.0 + np.arange(40.0)) @ laplacian).tocsr()
        assert refusal(lambda: Pardiso().factorize(laplacian)).status is Status.SINGULAR_TANGENT

    def test_a_zero_diagonal_is_no_obstacle(self) -> None:
        saddle = sp.csr_array(np.array([[2.0, 1.0, 1.0], [1.0, 3.0, 1.0], [1.0, 1.0, 0.0]]))
        for symmetric in ("detect", "never"):
            x = Pardiso(symmetric=symmetric).factorize(saddle).solve(np.ones(3))
            np.testing.assert_allclose(saddle @ x, np.ones(3), rtol=1e-12)

    def test_what_has_no_large_pivots_in_their_places_is_matched(self) -> None:
        """Rows of a regular matrix turned by one place: the diagonal is small beside its neighbours."""
        random = np.random.default_rng(2)
        regular = sp.random_array((60, 60), density=0.1, rng=random, format="csr") + 9.0 * sp.eye_array(60)
        turned = (regular[np.roll(np.arange(60), 1)] + 1e-14 * sp.eye_array(60)).tocsr()
        rhs = np.arange(60.0)
        first, second = (Pardiso().factorize(matrix) for matrix in (regular, turned))
        assert [factors.ordering for factors in (first, second)] == ["minimum degree, lu", "minimum degree, matched lu"]
        assert [factors.attempts for factors in (first, second)] == [1, 2]
        third = Pardiso().factorize(turned, second)
        assert third.attempts == 1
        for factors, matrix in ((first, regular), (second, turned), (third, turned)):
            np.testing.assert_allclose(matrix @ factors.solve(rhs), rhs, atol=1e-11)

    def test_many_entries_are_ordered_by_dissection(self) -> None:
        ones = np.ones(FEW // 3 + 1)
        chain = sp.diags_array([-ones[1:], 3.0 * ones, -1.5 * ones[1:]], offsets=[-1, 0, 1], format="csr")
        factors = Pardiso().factorize(chain)
        assert factors.ordering == "metis, lu"
        np.testing.assert_allclose(chain @ factors.solve(ones), ones, atol=1e-12)

    def test_values_that_the_analysis_does_not_fit_are_analysed_anew(self) -> None:
        random = np.random.default_rng(3)
        pattern = sp.random_array((40, 40), density=0.2, rng=random, format="csr") + sp.eye_array(40, format="csr")
        first = Pardiso().factorize(pattern)
        wild = pattern.copy()
        wild.data = 10.0 ** random.uniform(-9, 9, wild.nnz)
        rhs = np.ones(40)
        found = Pardiso().factorize(wild, first).solve(rhs)
        assert np.abs(wild @ found - rhs).max() <= 1e-8 * (abs(wild) @ np.abs(found)).max()

    def test_where_the_library_is_absent_the_way_out_is_said(self, monkeypatch: pytest.MonkeyPatch) -> None:
        monkeypatch.setattr(nlsolve_pardiso, "mkl", None)
        refused = refusal(lambda: Pardiso().factorize(tangent()))
        assert refused.status is Status.NOT_APPLICABLE
        assert "pip install 'nlsolve[pardiso]'" in refused.detail


@pytest.mark.parametrize("symmetric", [True, False])
def test_equilibrium_brings_rows_and_columns_to_one_size(symmetric: bool) -> None:
    random = np.random.default_rng(0)
    dense = random.standard_normal((9, 9))
    sizes = 10.0 ** random.uniform(-20, 20, 9)
    dense = sizes[:, None] * (dense + dense.T if symmetric else dense) * (sizes if symmetric else sizes[::-1])
    dense[3] = dense[:, 3] = 0.0
    rows, columns, even = equilibrated(sp.csr_array(dense), symmetric)
    np.testing.assert_array_equal(even.toarray(), rows[:, None] * dense * columns)
    assert is_symmetric(even) == symmetric
    largest = np.delete(np.abs(even.toarray()).max(axis=0), 3)
    assert ((largest >= 0.1) & (largest <= 8.0)).all()
    assert set(np.frexp(rows)[0]) == {0.5}


def test_the_diagonal_tells_the_size_of_a_positive_definite_matrix() -> None:
    random = np.random.default_rng(0)
    factor, sizes = random.standard_normal((9, 9)), 10.0 ** random.uniform(-20, 20, 9)
    dense = sizes[:, None] * (factor @ factor.T) * sizes
    rows, columns, even = even_by_diagonal(sp.csr_array(dense))
    np.testing.assert_array_equal(even.toarray(), rows[:, None] * dense * columns)
    assert ((even.diagonal() >= 0.25) & (even.diagonal() <= 1.0)).all()
    assert np.abs(even.toarray()).max() <= 1.0


def test_a_matrix_whose_entries_cancel_on_one_side_only_is_symmetric() -> None:
    """As triangles have it at the exact velocity: entries that vanish are stored in one half and not in the other."""
    stored = sp.csr_array((np.array([2.0, 1.0, 1e-16, 1.0, 2.0, 2.0]), [0, 1, 2, 0, 1, 2], [0, 3, 5, 6]), shape=(3, 3))
    assert stored.nnz == 6
    assert is_symmetric(stored)
    stored.data[2] = 1e-9
    assert not is_symmetric(stored)
