"""Equations 17 to 23 of the 2015 paper, order by order in numpy, beside `Series` and the homotopy's branch."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import pytest
import scipy.sparse as sp
import scipy.sparse.linalg as spla
from cases import near
from nlsolve_discretizers import MovingLeastSquares
from nlsolve_laws import PowerLaw
from nlsolve_scenes import StirringTool
from nlsolve_scenes.nodes.rings import Rings
from nlsolve_solvers.homotopy.branch import Branch
from nlsolve_solvers.homotopy.forms import FixedPoint

from nlsolve.contracts.continuum.cloud import node_major
from nlsolve.flow.momentum import Flow, Inertia
from nlsolve.series import Array, Series

ORDER = 25
INDICES = (0.1324, 0.5)
DENSITY_OVER_INCREMENT, PENALTY_MODULUS = 2.81e-9 / 1e-4, 10.0
AGREEMENT = 1e-12


ViscosityRule = Callable[[list[Array], list[Array], float, int], Array]


@dataclass(frozen=True)
class Scene:
    """An increment of the spin on coarse rings: its problem, the velocities it begins with, and an aged K*."""

    flow: Flow
    law: PowerLaw
    start: Array
    previous: Array
    aged: spla.SuperLU


def increment(index: float, start_index: float = 1.1, aged_index: float = 1.15) -> Scene:
    """The increment begins at the exact spin of another index, and K* is the tangent at that of a third one, both given
    as parts of the law's own index n.
    """
    scene, law = StirringTool(nodes=Rings(spacing=0.75)), PowerLaw(index=index)
    cloud = scene.cloud(law)
    operators = MovingLeastSquares(volume_points="nodes").operators(cloud, True)
    exact = scene.exact(PowerLaw(index=start_index * index), cloud.nodes, 0.0)
    assert exact is not None
    flow = Flow(
        cloud,
        operators,
        law,
        scene.boundary_velocity(cloud, law, 0.0),
        PENALTY_MODULUS,
        inertia=Inertia(DENSITY_OVER_INCREMENT, exact.velocity),
    )
    start = flow.unknowns(exact.velocity)
    aged = spla.splu(sp.csc_array(flow.jacobian(near(flow, aged_index * index))))
    return Scene(flow, law, start, exact.velocity, aged)


def convolution(x: list[Array], y: list[Array], j: int) -> Array:
    """Σ_{l=0..j} x_l y_{j−l}."""
    total = np.zeros_like(x[0])
    for l in range(j + 1):  # noqa: E741
        total += x[l] * y[j - l]
    return total


def next_viscosity(m: list[Array], e: list[Array], alpha: float, j: int) -> Array:
    """M_j from E dM = α M dE:  j E_0 M_j = α j M_0 E_j + α Σ l M_{j−l} E_l − Σ (j − l) M_{j−l} E_l,  0 < l < j."""
    total = alpha * j * m[0] * e[j]
    for l in range(1, j):  # noqa: E741
        total = total + alpha * l * m[j - l] * e[l] - (j - l) * m[j - l] * e[l]
    return total / (j * e[0])


def reversed_weights(m: list[Array], e: list[Array], alpha: float, j: int) -> Array:
    """`next_viscosity` with l M_{j−l} E_l in the last sum."""
    total = alpha * j * m[0] * e[j]
    for l in range(1, j):  # noqa: E741
        total = total + alpha * l * m[j - l] * e[l] - l * m[j - l] * e[l]
    return total / (j * e[0])


def no_weights(m: list[Array], e: list[Array], alpha: float, j: int) -> Array:
    """`next_viscosity` with M_{j−l} E_l in the last sum."""
    total = alpha * j * m[0] * e[j]
    for l in range(1, j):  # noqa: E741
        total = total + alpha * l * m[j - l] * e[l] - m[j - l] * e[l]
    return total / (j * e[0])


class ByHand:
    """V(a), ε̇(a), E(a) = ε̄² + ε₀², M(a) = μ, σ(a) and R(a), coefficient by coefficient, without `Series`."""

    def __init__(self, scene: Scene, viscosity: ViscosityRule = next_viscosity) -> None:
        self.scene, self.viscosity, operators = scene, viscosity, scene.flow.operators
        assert operators.volumetric is not None
        self.inside = node_major(scene.flow.cloud.interior)
        self.rate, self.force = operators.strain.rate, operators.strain.force
        self.dilatation, self.pressure_force = operators.volumetric.rate, operators.volumetric.force
        self.xx: list[Array] = []
        self.yy: list[Array] = []
        self.xy: list[Array] = []
        self.e: list[Array] = []
        self.m: list[Array] = []
        self.residuals: list[Array] = []
        velocity = scene.flow.velocity(scene.start).ravel()
        acceleration = velocity[self.inside] - scene.previous.ravel()[self.inside]
        self.push(velocity, acceleration)

    def push(self, velocity: Array, change: Array) -> None:
        """Coefficient j of all, from V_j at all nodes and the change of velocity inside that inertia acts on."""
        j, law = len(self.xx), self.scene.law
        for known, part in zip((self.xx, self.yy, self.xy), np.split(self.rate @ velocity, 3), strict=True):
            known.append(part)
        square = convolution(self.xx, self.xx, j) + convolution(self.yy, self.yy, j)
        self.e.append(2.0 / 3.0 * (square + 2.0 * convolution(self.xy, self.xy, j)))
        alpha = 0.5 * (law.index - 1.0)
        if j == 0:
            self.e[0] = self.e[0] + law.regularization**2
            strength = law.consistency * law.temperature**law.temperature_exponent
            self.m.append(strength / 3.0 * self.e[0] ** alpha)
        else:
            self.m.append(self.viscosity(self.m, self.e, alpha, j))
        stress = np.concatenate([2.0 * convolution(self.m, part, j) for part in (self.xx, self.yy, self.xy)])
        pressure = -PENALTY_MODULUS * (self.dilatation @ velocity)
        self.residuals.append(DENSITY_OVER_INCREMENT * change - self.force @ stress + self.pressure_force @ pressure)

    def append(self, w_j: Array) -> None:
        """Push W_j, the velocities inside; the boundary's do not change with a."""
        velocity = np.zeros(2 * len(self.scene.flow.cloud.nodes))
        velocity[self.inside] = w_j
        self.push(velocity, w_j)

    def terms(self, order: int) -> list[Array]:
        """K* W_1 = −G(0),  K* W_j = K* W_{j−1} − [G]_{j−1}."""
        terms: list[Array] = []
        rhs = -self.residuals[0]
        for j in range(1, order + 1):
            if j > 1:
                rhs = rhs - self.residuals[j - 1]
            terms.append(self.scene.aged.solve(rhs))
            self.append(terms[-1])
        return terms


def apart(ours: Array, theirs: Array) -> float:
    """‖x − y‖/‖y‖."""
    return float(np.linalg.norm(ours - theirs) / np.linalg.norm(theirs))


@pytest.mark.parametrize("index", INDICES)
def test_the_expansion_of_a_flow_is_the_papers(index: float) -> None:
    scene = increment(index)
    by_hand = ByHand(scene)
    terms = by_hand.terms(ORDER)
    expansion = scene.flow.expand(scene.start)
    for w_j in terms:
        expansion.append(w_j)
    for j, by_hand_j in enumerate(by_hand.residuals):
        assert apart(expansion.coefficient(j), by_hand_j) < AGREEMENT, j
    # Neither the volumetric term nor inertia is too small to be seen at this agreement.
    last, size = terms[-1], np.linalg.norm(by_hand.residuals[-1])
    pushed = np.zeros(2 * len(scene.flow.cloud.nodes))
    pushed[by_hand.inside] = last
    volumetric = PENALTY_MODULUS * (by_hand.pressure_force @ (by_hand.dilatation @ pushed))
    assert np.linalg.norm(volumetric) > 1e3 * AGREEMENT * size
    assert np.linalg.norm(DENSITY_OVER_INCREMENT * last) > 1e3 * AGREEMENT * size


@pytest.mark.parametrize("index", INDICES)
def test_the_branch_of_the_homotopy_is_the_papers(index: float) -> None:
    scene = increment(index)
    terms = ByHand(scene).terms(ORDER)
    branch = Branch(scene.flow, scene.start, FixedPoint(), "series")
    for _ in range(ORDER):
        rhs = branch.recurrence.right_hand_side()
        branch.append(rhs, scene.aged.solve(rhs))
    for j, (ours, theirs) in enumerate(zip(branch.terms, terms, strict=True), 1):
        assert apart(ours, theirs) < AGREEMENT, j


@pytest.mark.parametrize("index", INDICES)
def test_the_viscosity_is_a_power_of_the_strain_rate(index: float) -> None:
    by_hand = ByHand(increment(index))
    by_hand.terms(ORDER)
    path = Series(by_hand.e[0])
    for e_j in by_hand.e[1:]:
        path.append(e_j)
    power = path ** (0.5 * (index - 1.0))
    strength = by_hand.m[0] / power.coefficient(0)
    for j, m_j in enumerate(by_hand.m):
        assert apart(strength * power.coefficient(j), m_j) < AGREEMENT, j


@pytest.mark.parametrize("wrong", [reversed_weights, no_weights])
@pytest.mark.parametrize("index", INDICES)
def test_other_weights_in_the_last_sum_of_23e_make_the_series_grow(index: float, wrong: ViscosityRule) -> None:
    """Only (j − l) M_{j−l} E_l will do: the first two terms do not tell, order 20 does."""
    scene = increment(index, 1.02, 1.04)
    right, grown = ByHand(scene).terms(20), ByHand(scene, wrong).terms(20)
    assert [apart(grown[j], right[j]) for j in (0, 1)] == [0.0, 0.0]
    assert np.linalg.norm(grown[19]) > 100.0 * np.linalg.norm(right[19])
