"""∫ s(ε̇(v)) : ε̇(w) − p div w − q div v = 0 for all w, q : Taylor-Hood elements of scikit-fem for a flow of nlsolve.

Velocities of degree 2 on triangles whose sides on the walls are parabolas, pressures of degree 1, so that the flow is
incompressible without a penalty. The law is nlsolve's own formula, the triangles are Delaunay's of the cloud. As strong
a rival as is easily written: gradients are tabulated by scikit-fem once, element matrices are batched products, places
in the sparse matrix are found once, the linear solver keeps its analysis, and Newton's steps are halved until the
residual falls.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import scipy
import scipy.sparse as sp
from nlsolve_discretizers.elements.mesh import Mesh
from nlsolve_discretizers.weights.triangles import Triangles
from skfem import Basis, BilinearForm, ElementTriP1, ElementTriP2, ElementVector, MeshTri, MeshTri2
from skfem.helpers import div

from nlsolve.contracts.continuum.law import CONTRACTION, stress, tangent_moduli
from nlsolve.plugin import Cloud, ConstitutiveLaw, LinearSolver

ARMIJO, SHORTEST, MOST_STEPS = 1e-4, 1e-6, 80


class TaylorHood:
    """The steady flow in an annulus about the origin with prescribed velocities on both circles.

    cloud : the vertices; its boundary groups are circles.
    linear : factorises the saddle point's matrix.
    points : where the velocities are, (V, 2) [mm].
    unknowns : their components that are solved for, among all `size` of them.
    """

    def __init__(self, cloud: Cloud, linear: LinearSolver) -> None:
        self.linear, self.factors = linear, None
        self.factorizations = 0
        straight = MeshTri(cloud.nodes.T.copy(), Triangles.of(cloud).corners.T.copy())
        mesh = MeshTri2.from_mesh(straight)
        sides = straight.boundary_facets()
        middles = len(cloud.nodes) + sides
        places = mesh.doflocs.copy()
        radii = np.hypot(*cloud.nodes[straight.facets[0, sides]].T)
        places[:, middles] *= radii / np.hypot(*places[:, middles])
        mesh = MeshTri2(places, mesh.t)
        velocities = Basis(mesh, ElementVector(ElementTriP2()), intorder=4)
        pressures = velocities.with_element(ElementTriP1())
        self._numbers = np.concatenate([velocities.nodal_dofs, velocities.facet_dofs], axis=1)  # (2, V)
        self.points = velocities.doflocs[:, self._numbers[0]].T
        on_wall = np.zeros(len(self.points), dtype=bool)
        on_wall[cloud.boundary] = True
        on_wall[middles] = True
        self.inside, self.wall = np.flatnonzero(~on_wall), np.flatnonzero(on_wall)
        self._weights = velocities.dx  # (T, Q)
        gradients = np.stack(
            [velocities.basis[i][0].grad for i in range(velocities.Nbfun)], axis=-1
        )  # (2, 2, T, Q, 12)
        self._strain = np.stack(  # (T, Q, 3, 12)
            [gradients[0, 0], gradients[1, 1], 0.5 * (gradients[0, 1] + gradients[1, 0])], axis=2
        )
        self._elements = velocities.element_dofs  # (12, T)
        self.unknowns = self._numbers[:, self.inside].T.ravel()
        self.size = velocities.N
        couple = -BilinearForm(lambda v, q, w: q * div(v)).assemble(velocities, pressures).tocsr()[1:]  # p_0 = 0
        self._couple = couple
        self._prepare(couple[:, self.unknowns])

    def wall_velocity(self, scene: Any, law: ConstitutiveLaw, cloud: Cloud) -> np.ndarray:
        """V at `points[wall]`, (W, 2), as the scene prescribes it at the walls' nodes and the middles between them."""
        walls = Mesh.of(cloud)
        nearest = scipy.spatial.cKDTree(walls.nodes[walls.boundary]).query(self.points[self.wall])[1]
        found: np.ndarray = scene.boundary_velocity(walls, law, 0.0)[nearest]
        return found

    def _prepare(self, couple: Any) -> None:
        """The pattern of [[K, Bᵀ], [B, 0]], and which entries of element matrices add up to each of its entries."""
        unknowns, count = len(self.unknowns), self._elements.shape[1]
        number = np.full(self.size, -1)
        number[self.unknowns] = np.arange(unknowns)
        local = number[self._elements].T  # (T, 12)
        rows, columns = (np.broadcast_to(a, (count, 12, 12)).ravel() for a in (local[:, :, None], local[:, None, :]))
        self._kept = np.flatnonzero((rows >= 0) & (columns >= 0))
        rows, columns = rows[self._kept], columns[self._kept]
        stiffness = sp.csr_array((np.ones(len(rows)), (rows, columns)), shape=(unknowns, unknowns))
        self._matrix = whole = sp.block_array([[stiffness, couple.T], [couple, None]], format="csr")
        whole.sort_indices()
        key = np.repeat(np.arange(whole.shape[0]), np.diff(whole.indptr)) * whole.shape[0] + whole.indices
        place = np.searchsorted(key, rows * whole.shape[0] + columns)
        self._scatter = sp.csr_array(
            (np.ones(len(place)), (place, np.arange(len(place)))), shape=(whole.nnz, len(place))
        )
        self._coupling = np.where(self._scatter.sum(axis=1) > 0.0, 0.0, whole.data)

    def rates(self, values: np.ndarray) -> np.ndarray:
        """ε̇ at the quadrature points, (3, T Q)."""
        rates = np.matmul(self._strain.reshape(len(self._weights), -1, 12), values[self._elements].T[..., None])
        return rates.reshape(-1, 3).T

    def forces(self, law: ConstitutiveLaw, values: np.ndarray) -> np.ndarray:
        """∫ s : ε̇(w), for all velocities."""
        rates = self.rates(values)
        weighted = (stress(law, rates) * CONTRACTION[:, None]).T.reshape(*self._weights.shape, 3) * self._weights[
            ..., None
        ]
        local = np.matmul(weighted.reshape(len(weighted), 1, -1), self._strain.reshape(len(weighted), -1, 12))
        return np.bincount(self._elements.T.ravel(), local.ravel(), minlength=self.size)

    def matrix(self, law: ConstitutiveLaw, values: np.ndarray) -> Any:
        """[[K, Bᵀ], [B, 0]] for the velocities inside and all pressures but the first."""
        moduli = tangent_moduli(law, self.rates(values)) * CONTRACTION[:, None, None] * self._weights.ravel()
        local = moduli.transpose(2, 0, 1).reshape(*self._weights.shape, 3, 3)
        right = np.matmul(local, self._strain).reshape(len(self._weights), -1, 12)
        left = self._strain.reshape(len(self._weights), -1, 12).transpose(0, 2, 1)
        entries = np.matmul(left, right).ravel()[self._kept]
        data = self._scatter @ entries + self._coupling
        return sp.csr_array((data, self._matrix.indices, self._matrix.indptr), shape=self._matrix.shape)

    def solve(self, laws: list[ConstitutiveLaw], walls: np.ndarray, tolerance: float) -> np.ndarray:
        """Velocities (V, 2) of the last law; each begins with that of the law before, the first from rest.

        walls : velocities at `points[wall]`, (W, 2). tolerance : largest ‖R‖ over ‖forces‖.
        """
        values, pressure = np.zeros(self.size), np.zeros(self._couple.shape[0])
        values[self._numbers[:, self.wall].T.ravel()] = walls.ravel()
        at_rest = True
        for law in laws:
            for _ in range(MOST_STEPS):
                force = self.forces(law, values)
                residual = self._residual(force, values, pressure)
                if not at_rest and np.linalg.norm(residual) <= tolerance * np.linalg.norm(force):
                    break
                self.factors = self.linear.factorize(self.matrix(law, values), self.factors)
                self.factorizations += 1
                change = self.factors.solve(-residual)
                direction, rise = np.zeros(self.size), change[len(self.unknowns) :]
                direction[self.unknowns] = change[: len(self.unknowns)]
                length, size = 1.0, np.linalg.norm(residual)
                while not at_rest and length > SHORTEST:
                    ahead, there = values + length * direction, pressure + length * rise
                    if (
                        np.linalg.norm(self._residual(self.forces(law, ahead), ahead, there))
                        < (1 - ARMIJO * length) * size
                    ):
                        break
                    length *= 0.5
                values, pressure, at_rest = values + length * direction, pressure + length * rise, False
            else:
                raise RuntimeError(f"Newton's method has not arrived in {MOST_STEPS} steps")
        return values[self._numbers].T

    def _residual(self, force: np.ndarray, values: np.ndarray, pressure: np.ndarray) -> np.ndarray:
        """R = (∫ s : ε̇(w) − p div w, −∫ q div v) for the velocities inside and all pressures but the first."""
        return np.concatenate([(force + self._couple.T @ pressure)[self.unknowns], self._couple @ values])
