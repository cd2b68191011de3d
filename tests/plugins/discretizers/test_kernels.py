"""What is compiled: the same numbers as numpy's, compiled once, and nothing that must be there."""

from __future__ import annotations

import importlib
import subprocess
import sys
from collections.abc import Iterator
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import scipy.sparse as sp
from clouds import CLOUDS, jittered_points
from nlsolve_discretizers import LinearTriangles, MovingLeastSquares, RadialBasis, kernels
from nlsolve_discretizers.kernels import machine_code, normal_equations, quadrants, ranking, rows
from nlsolve_discretizers.kernels.machine_code import compiled, compiler_name, numpy_alone
from nlsolve_discretizers.kernels.offsets import offsets, over_radius
from nlsolve_discretizers.weights.supports import Supports

from nlsolve.plugin import Cloud, Discretizer

needs_numba = pytest.mark.skipif(compiler_name() is None, reason="numba is not installed: pip install 'nlsolve[numba]'")

FORMS: dict[str, Discretizer] = {
    "mls": MovingLeastSquares(),
    "mls, ragged, degree 3": MovingLeastSquares(degree=3, support=14, force_support=14),
    "mls, by radius": MovingLeastSquares(radius=0.7),
    "mls, conservative, spline": MovingLeastSquares(form="conservative", weight="spline"),
    "mls, volume at nodes": MovingLeastSquares(volume_points="nodes"),
    "rbf": RadialBasis(form="strong"),
}


def moved(cloud: Cloud, seed: int) -> Cloud:
    """Every inner node moved by up to a tenth of its spacing."""
    shift = 0.1 * np.random.default_rng(seed).uniform(-1.0, 1.0, cloud.nodes.shape) * cloud.nearest_distance[:, None]
    shift[cloud.boundary] = 0.0
    return cloud.moved_to(cloud.nodes + shift)


def of_a_march(discretizer: Discretizer, cloud: Cloud) -> Iterator[Any]:
    """B, S, B_θ and S_θ of a cloud and of two more to which its nodes move."""
    operators = discretizer.operators(cloud, True)
    for seed in range(3):
        yield from (operators.strain.rate, operators.strain.force)
        assert operators.volumetric is not None
        yield from (operators.volumetric.rate, operators.volumetric.force)
        cloud = moved(cloud, seed)
        operators = discretizer.renewed(operators, cloud)


# The same numbers.


@needs_numba
@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize("name", CLOUDS)
def test_compiled_products_are_those_of_the_matrices(form: str, name: str) -> None:
    """Of the matrices and of their magnitudes, for vectors of numbers and of a strided array."""
    random = np.random.default_rng(4)
    for operator in of_a_march(FORMS[form], CLOUDS[name]):
        vector = random.standard_normal((operator.shape[1], 2))[:, 0]
        for one, matrix in ((operator, operator.tocsr()), (abs(operator), abs(operator.tocsr()))):
            expected = matrix @ vector
            np.testing.assert_allclose(one @ vector, expected, rtol=0.0, atol=1e-13 * (abs(matrix) @ abs(vector)).max())


def test_an_operator_that_is_not_assembled_is_read_and_combined_like_a_matrix() -> None:
    operator = MovingLeastSquares().operators(next(iter(CLOUDS.values())), False).strain.rate
    matrix = operator.tocsr()
    rows, columns = np.arange(operator.shape[0]), np.ones((operator.shape[1], 2))
    for one, other in (
        (operator[:3], matrix[:3]),
        (operator.T, matrix.T),
        (-operator, -matrix),
        (2.0 * operator, 2.0 * matrix),
        (operator + operator, 2.0 * matrix),
        (operator - operator, 0.0 * matrix),
        (matrix - operator, 0.0 * matrix),
        (sp.diags_array(rows + 1.0) @ operator, sp.diags_array(rows + 1.0) @ matrix),
        (operator @ sp.eye_array(operator.shape[1]), matrix),
    ):
        assert abs(one - other).max() == 0.0
    np.testing.assert_array_equal(operator @ columns, matrix @ columns)
    np.testing.assert_array_equal(rows @ operator, rows @ matrix)
    assert operator.nnz == matrix.nnz
    with pytest.raises(AttributeError, match="nothing"):
        operator.nothing  # noqa: B018


def test_derivatives_in_the_unit_of_the_radius() -> None:
    random = np.random.default_rng(5)
    x, y, radius = random.standard_normal((12, 7)), random.standard_normal((12, 7)), random.random(7)
    given = x, y, np.ones((12, 7)), 2, ((0, 0), (1, 0), (1, 1))
    phi, smallest = normal_equations.fitted(*given, np.ones(7))
    over, same = normal_equations.fitted(*given, radius)
    np.testing.assert_allclose(over, phi / radius ** np.array([[[0]], [[1]], [[2]]]), rtol=1e-12)
    np.testing.assert_array_equal(smallest, same)


@needs_numba
@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize("name", CLOUDS)
def test_compiled_operators_are_numpys(form: str, name: str) -> None:
    discretizer, cloud = FORMS[form], CLOUDS[name]
    compiled_ones = list(of_a_march(discretizer, cloud))
    with numpy_alone():
        others = list(of_a_march(discretizer, cloud))
    for one, other in zip(compiled_ones, others, strict=True):
        np.testing.assert_array_equal(one.indices, other.indices)
        np.testing.assert_array_equal(one.indptr, other.indptr)
        np.testing.assert_allclose(one.data, other.data, rtol=0.0, atol=1e-13 * np.abs(other.data).max())


@needs_numba
@pytest.mark.parametrize("degree", [1, 2, 3, 4])
@pytest.mark.parametrize("targets", [1, normal_equations.AT_ONCE - 1, normal_equations.AT_ONCE, 100])
def test_compiled_weights_are_numpys(degree: int, targets: int) -> None:
    """Of values and of derivatives up to the second, for a full block, a part of one, and several."""
    sources, places = jittered_points(3), 0.1 + 0.8 * np.random.default_rng(1).random((targets, 2))
    supports = Supports.nearest(sources, places, 6 * (degree + 1))
    x, y = offsets(sources, places, supports.index) / supports.radius
    derivatives = (0, 0), (1, 0), (0, 1), *([(2, 0), (1, 1)] * (degree > 1))
    given = x, y, np.exp(-9.0 * (x * x + y * y)), degree, derivatives, supports.radius
    phi, smallest = normal_equations.fitted(*given)
    with numpy_alone():
        other, pivot = normal_equations.fitted(*given)
    np.testing.assert_allclose(phi, other, rtol=0.0, atol=1e-13 * np.abs(other).max())
    np.testing.assert_allclose(smallest, pivot, rtol=1e-13)


@needs_numba
def test_compiled_weights_tell_supports_that_determine_nothing() -> None:
    """All neighbours at one place, on one line, and without weights."""
    x, y, w = np.zeros((8, 3)), np.zeros((8, 3)), np.ones((8, 3))
    x[:, 1], w[:, 2] = np.linspace(-1.0, 1.0, 8), 0.0
    _, smallest = normal_equations.fitted(x, y, w, 2, ((1, 0),), np.ones(3))
    with numpy_alone():
        _, other = normal_equations.fitted(x, y, w, 2, ((1, 0),), np.ones(3))
    np.testing.assert_array_equal(smallest, other)
    assert (smallest < 1e-7).all()


@needs_numba
def test_compiled_places_are_numpys() -> None:
    sources, targets = jittered_points(3), jittered_points(4)
    supports = Supports.nearest(sources, targets, 9)
    places = over_radius(sources, targets, supports.index, supports.radius)
    with numpy_alone():
        np.testing.assert_array_equal(places, over_radius(sources, targets, supports.index, supports.radius))


@needs_numba
@pytest.mark.parametrize("renumbered", [False, True])
def test_compiled_ranks_are_numpys(renumbered: bool) -> None:
    """For targets whose nearest sources come first already, and for others; some sources are lost."""
    random = np.random.default_rng(2)
    sources, targets, rows = random.random((50, 2)), random.random((40, 2)), random.permutation(40)
    index = np.argsort(random.random((40, 50)), axis=1)[:, :21]
    index[random.random(index.shape) < 0.2] = -1
    index[rows[:20]] = np.argsort(np.linalg.norm(targets[:20, None] - sources, axis=2), axis=1)[:, :21]
    index[:, :9].sort(axis=1)
    numbers = np.append(random.permutation(50) if renumbered else np.arange(50), -1)
    given = sources, targets, index, rows, numbers, 9
    ranks, distances = ranking.ranked(*given)
    with numpy_alone():
        others, same = ranking.ranked(*given)
    np.testing.assert_array_equal(ranks[:, :9], others[:, :9])
    np.testing.assert_array_equal(np.sort(ranks[:, 9:]), np.sort(others[:, 9:]))
    np.testing.assert_array_equal(distances, same)


@needs_numba
@pytest.mark.parametrize("read_only", [False, True])
def test_compiled_quadrants_are_numpys(read_only: bool) -> None:
    """For neighbours on axes, at the target itself, and for ragged counts."""
    random = np.random.default_rng(3)
    sources, targets = random.integers(-3, 4, (60, 2)) + 0.0, random.integers(-3, 4, (50, 2)) + 0.0
    given = sources, targets, random.integers(0, 60, (50, 9)), random.integers(1, 10, 50)
    for array in given:
        array.flags.writeable = not read_only
    around = quadrants.surrounded(*given)
    with numpy_alone():
        np.testing.assert_array_equal(around, quadrants.surrounded(*given))
    assert 0 < around.sum() < len(around)


@needs_numba
@pytest.mark.parametrize("of_target_together", [False, True])
def test_compiled_rows_are_numpys(of_target_together: bool) -> None:
    """Also of derivatives that are not one after the other in memory, with zeros to be left out."""
    random = np.random.default_rng(4)
    near, derivatives = random.integers(0, 30, (20, 7)), np.moveaxis(random.random((20, 7, 2)), 2, 0)
    derivatives[:, random.random((20, 7)) < 0.3] = 0.0
    terms = [[(0, 0, 1.0), (31, 1, 0.5)], [(5, 1, 2.0), (40, 0, -1.0)]]
    matrix = rows.sparse_rows(near, derivatives, terms, 1, 80, of_target_together)
    with numpy_alone():
        other = rows.sparse_rows(near, derivatives, terms, 1, 80, of_target_together)
    for part in ("data", "indices", "indptr"):
        np.testing.assert_array_equal(getattr(matrix, part), getattr(other, part))
    assert matrix.shape == other.shape == (40, 80)


# Where there is no compiler, or no place for what it makes.


@pytest.fixture
def fresh() -> Iterator[None]:
    """Nothing is known of the compiler, before and after."""
    machine_code.compiler.cache_clear()
    machine_code._code.cache_clear()
    yield
    machine_code.compiler.cache_clear()
    machine_code._code.cache_clear()


@pytest.mark.usefixtures("fresh")
def test_without_numba_numpy_computes(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(machine_code, "find_spec", lambda name: None)
    assert compiler_name() is None
    assert normal_equations.machine_code() is None
    assert MovingLeastSquares().compiled_by() is None


@pytest.mark.usefixtures("fresh")
def test_a_numba_that_cannot_be_imported_is_warned_of(monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(name: str) -> Any:
        raise ImportError("Numba needs NumPy 1.0 or less")

    monkeypatch.setattr(machine_code, "find_spec", lambda name: "somewhere")
    monkeypatch.setattr(machine_code, "import_module", refuse)
    with pytest.warns(RuntimeWarning, match=r"numba cannot be used: Numba needs NumPy 1\.0"):
        assert compiler_name() is None


@needs_numba
@pytest.mark.usefixtures("fresh")
def test_numba_that_is_told_not_to_compile_is_none(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(importlib.import_module("numba").config, "DISABLE_JIT", 1)
    assert compiler_name() is None


@pytest.mark.usefixtures("fresh")
def test_where_nothing_can_be_kept_it_is_compiled_in_every_process(monkeypatch: pytest.MonkeyPatch) -> None:
    asked: list[bool] = []

    def njit(signature: str, cache: bool = False, **options: Any) -> Any:
        asked.append(cache)
        if cache:
            raise RuntimeError("cannot cache function: no locator available")
        return lambda function: function

    numba = SimpleNamespace(njit=njit, uint32="i4", float64="f8", int64="i8", boolean="b1")
    monkeypatch.setattr(machine_code, "compiler", lambda: numba)
    assert compiled(ranking.one_by_one, "f0 i0") is ranking.one_by_one
    assert asked == [True, False]


def test_the_row_says_what_was_compiled() -> None:
    for discretizer in (MovingLeastSquares(), RadialBasis(), LinearTriangles()):
        assert discretizer.compiled_by() == compiler_name()
        with numpy_alone():
            assert discretizer.compiled_by() is None


# When it is compiled.


def told_by_a_process(code: str) -> str:
    """What a process prints."""
    told = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    return told.stdout.strip()


@needs_numba
def test_another_process_compiles_nothing() -> None:
    kernels.loaded()
    code = (
        "from nlsolve_discretizers import kernels\n"
        "for kernel in kernels.KERNELS:\n"
        "    stats = kernel.machine_code().stats\n"
        "    print(sum(stats.cache_misses.values()), sum(stats.cache_hits.values()))"
    )
    assert told_by_a_process(code).splitlines() == ["0 1"] * len(kernels.KERNELS)


def test_a_study_is_read_and_planned_without_the_compiler() -> None:
    code = (
        "import nlsolve, sys\n"
        "study = nlsolve.Study.from_dict({'question': 'q', 'scene': {'kind': 'stirring-tool'}, 'law': {'kind': "
        "'power-law'}, 'discretizer': {'kind': 'mls'}, 'solver': {'kind': 'newton'}})\n"
        "print(len(study.cases), 'numba' in sys.modules)"
    )
    assert told_by_a_process(code) == "1 False"
