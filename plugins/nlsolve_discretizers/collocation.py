"""B and S by collocation: strain rates at stress points from nodes, and what returns the stress there to the nodes."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Iterator
from dataclasses import replace
from typing import Any, ClassVar, Literal

import numpy as np
from pydantic import Field

from nlsolve.plugin import Cloud, Discretizer, Operators, PointOperators, SolveError
from nlsolve_discretizers import kernels
from nlsolve_discretizers.conservation import conserving
from nlsolve_discretizers.kernels.offsets import over_radius
from nlsolve_discretizers.kernels.rows import sparse_rows
from nlsolve_discretizers.weights.assembly import Gradient
from nlsolve_discretizers.weights.diagnostics import diagnosis
from nlsolve_discretizers.weights.least_squares import Derivatives, monomials
from nlsolve_discretizers.weights.lists import Lists
from nlsolve_discretizers.weights.neighbours import Neighbours
from nlsolve_discretizers.weights.supports import Supports
from nlsolve_discretizers.weights.triangles import Triangles

AT_ONCE = 1024  # targets whose local systems are in the cache together
VALUE, GRADIENT = ((0, 0),), ((1, 0), (0, 1))


class Collocation(Discretizer):
    """Derivatives of first order only, once each way, by weights at scattered neighbours.

    points : between, strain rates and stresses live at the midpoints of the cloud's Delaunay edges, the default: no
             second derivative and no odd-even mode; or nodes, the composed form of the 2015 paper, kept to be compared
             with: it decouples neighbouring nodes and fails for n → 0.
    form :   strong, the divergence of stress is collocated at the nodes; or conservative, S = −Bᵀ A with gradients
             corrected for the discrete divergence theorem: a symmetric tangent, and a residual with a potential.

    The volumetric term has points of its own, about one a node, so that the penalty does not lock: patches of two
    Delaunay triangles ("pairs"), or the nodes with collocation both ways ("nodes").
    """

    points: Literal["between", "nodes"] = Field("between", description="where strain rates and stresses are taken")
    form: Literal["strong", "conservative"] | None = Field("strong", description="how stresses act on the nodes")
    volume_points: Literal["pairs", "nodes"] = Field("pairs", description="where the dilatation is taken")
    degree: int = Field(2, ge=1, le=4, description="degree of the polynomials")
    balanced: bool = Field(True, description="supports grow until every quadrant that has nodes nearby is served")

    weak: ClassVar[float] = 1e-3
    """Quality of a support below which it is enlarged."""
    growths: ClassVar[int] = 3
    """How often a weak support is enlarged, by half each time, before it is refused."""

    def compiled_by(self) -> str | None:
        """numba, where it is installed."""
        return kernels.loaded()

    @abstractmethod
    def neighbour_count(self, role: str) -> int | None:
        """Number of neighbours of a support in a role, before any grows; None where a radius tells."""

    @abstractmethod
    def supports(
        self, sources: np.ndarray, targets: np.ndarray, role: str, cloud: Cloud | None, lists: Lists | None = None
    ) -> Supports:
        """Neighbours of the targets (T, 2) among the sources (S, 2) [mm], for the weights in a role: "strain", "force"
        or "volume" on a cloud, "value" at any points.

        lists : of `neighbour_count` sources, where there are such.
        """

    @abstractmethod
    def local_weights(
        self, places: np.ndarray, radius: np.ndarray, derivatives: Derivatives
    ) -> tuple[np.ndarray, np.ndarray]:
        """Weights (D, T, k) of D derivatives for neighbours at `places` x, y, |(x, y)| (3, k, T) over the radius (T,)
        [mm], and the quality (T,) of the supports: 0 for one that determines nothing.
        """

    @abstractmethod
    def refusal(self, count: int, place: np.ndarray, quality: float) -> SolveError | None:
        """The error for the worst support, of `count` neighbours around `place` (2,) [mm]; None if it will do."""

    def weights(
        self,
        sources: np.ndarray,
        targets: np.ndarray,
        role: str,
        derivatives: Derivatives,
        cloud: Cloud | None = None,
        near: Neighbours | None = None,
    ) -> tuple[Supports, np.ndarray]:
        """Supports and weights (D, T, k) for `derivatives`; weak supports are enlarged.

        near : what is known of the cloud's neighbours; the supports are put there.
        Raises SolveError naming the place of a support that stays weak.
        """
        supports = self._supports(sources, targets, role, cloud, near)
        quality = np.empty(len(targets))
        found = np.zeros((len(derivatives), *supports.index.shape))
        renew = np.arange(len(targets))
        for attempt in range(self.growths + 1):
            for count, which in _batches(supports.count, renew):
                radius = supports.radius[which]
                near_by = over_radius(sources, targets[which], supports.index[which, :count], radius)
                found[:, which, :count], quality[which] = self.local_weights(near_by, radius, derivatives)
            renew = np.flatnonzero(~(quality >= self.weak))
            larger = np.minimum(supports.count[renew] + (supports.count[renew] + 1) // 2, len(sources) - 1)
            if attempt == self.growths or not (larger > supports.count[renew]).any():
                break
            supports = supports.replaced(renew, Supports.nearest(sources, targets[renew], larger))
            found = np.pad(found, ((0, 0), (0, 0), (0, supports.index.shape[1] - found.shape[2])))
            found[:, renew] = 0.0
        worst = int(np.fmax(quality, 0.0).argmin())  # of what is not a number 0
        error = self.refusal(int(supports.count[worst]), targets[worst], float(quality[worst]))
        if error is not None:
            raise error
        if near is not None:
            near.supports[role] = supports
        return supports, found

    def _supports(
        self, sources: np.ndarray, targets: np.ndarray, role: str, cloud: Cloud | None, near: Neighbours | None
    ) -> Supports:
        if near is None:
            return self.supports(sources, targets, role, cloud)
        if role in near.supports:
            return near.supports[role].moved(sources, targets)
        count = self.neighbour_count(role)
        lists = None if count is None else near.listed(role, sources, targets, count)
        return self.supports(sources, targets, role, cloud, lists)

    def operators(self, cloud: Cloud, volumetric: bool) -> Operators:
        """B, S and, when asked for, B_θ, S_θ."""
        return self._operators(Neighbours(Triangles.of(cloud)), volumetric)

    def moved(self, operators: Operators, cloud: Cloud) -> Operators | None:
        """The operators on the moved cloud, with the triangles, patches and supports of before; None if a triangle is
        turned inside out.
        """
        near = operators.neighbours.moved_to(cloud)
        return self._operators(near, operators.volumetric is not None) if near.triangles.are_upright else None

    def renewed(self, operators: Operators, cloud: Cloud) -> Operators:
        """The operators on the moved cloud, all neighbours found anew with the help of those of before."""
        near = operators.neighbours.renewed(cloud, self._ends if self.points == "between" else None)
        return self._operators(near, operators.volumetric is not None)

    def _ends(self, triangles: Triangles) -> np.ndarray:
        """The edges whose midpoints are the stress points between neighbours, (M, 2)."""
        return triangles.edges[0] if self.form == "conservative" else triangles.inner_edges

    def _operators(self, near: Neighbours, volumetric: bool) -> Operators:
        build = self._conservative if self.form == "conservative" else self._strong
        return replace(build(near, volumetric), neighbours=near)

    def _strong(self, near: Neighbours, volumetric: bool) -> Operators:
        triangles, cloud = near.triangles, near.triangles.cloud
        nodes, interior = cloud.nodes, cloud.interior
        points = triangles.midpoints() if self.points == "between" else nodes
        rate = self._gradient(nodes, points, "strain", cloud, near).strain(len(nodes))
        force = self._gradient(points, nodes[interior], "force", cloud, near).divergence_of_stress(len(points))
        strain = PointOperators(rate, force, points)
        if not volumetric:
            return Operators(strain)
        if self.volume_points == "pairs":
            return Operators(strain, triangles.patches().strong())
        gradient = self._gradient(nodes, nodes, "volume", cloud, near)
        pressure_force = gradient.at(interior).of_pressure(len(nodes))
        return Operators(strain, PointOperators(gradient.divergence(len(nodes)), pressure_force, nodes))

    def _conservative(self, near: Neighbours, volumetric: bool) -> Operators:
        triangles, cloud = near.triangles, near.triangles.cloud
        nodes = cloud.nodes
        points, areas = triangles.diamonds() if self.points == "between" else (nodes, triangles.node_areas)
        gradient = conserving(cloud, points, areas, self._gradient(nodes, points, "strain", cloud, near))
        strain = PointOperators.conservative(cloud, gradient.strain(len(nodes)), points, areas)
        node_areas = triangles.node_areas[cloud.interior]
        if not volumetric:
            return Operators(strain, None, node_areas)
        if self.volume_points == "pairs":
            return Operators(strain, triangles.patches().conservative(), node_areas)
        gradient = conserving(cloud, nodes, triangles.node_areas, self._gradient(nodes, nodes, "volume", cloud, near))
        dilatation = gradient.divergence(len(nodes))
        return Operators(
            strain, PointOperators.conservative(cloud, dilatation, nodes, triangles.node_areas), node_areas
        )

    def gradient(self, cloud: Cloud) -> tuple[Any, Any]:
        """∂/∂x and ∂/∂y at the nodes."""
        return self._gradient(cloud.nodes, cloud.nodes, "volume", cloud).matrices(len(cloud.nodes))

    def values(self, sources: np.ndarray, targets: np.ndarray) -> Any:
        """Sparse (T, N) matrix of values."""
        supports, value = self.weights(sources, targets, "value", VALUE)
        return sparse_rows(supports.index, value, [[(0, 0, 1.0)]], 1, len(sources))

    def diagnostics(self, cloud: Cloud) -> list[dict[str, Any]]:
        """One row each for the strain, force and volume weights of a cloud."""
        points = Triangles.of(cloud).midpoints() if self.points == "between" else cloud.nodes
        roles = {
            "strain": (cloud.nodes, points),
            "force": (points, cloud.nodes[cloud.interior]),
            "volume": (cloud.nodes, cloud.nodes),
        }
        rows = []
        for role, (sources, targets) in roles.items():
            plain = self.with_(balanced=False).supports(sources, targets, role, cloud)
            supports, weights = self.weights(sources, targets, role, GRADIENT, cloud)
            row = diagnosis(sources, targets, supports, weights, self.degree)
            rows.append({"operator": role, **row, "grown": int((supports.count > plain.count).sum())})
        return rows

    def _gradient(
        self, sources: np.ndarray, targets: np.ndarray, role: str, cloud: Cloud, near: Neighbours | None = None
    ) -> Gradient:
        """∂/∂x and ∂/∂y at the targets."""
        supports, both = self.weights(sources, targets, role, GRADIENT, cloud, near)
        return Gradient(supports.index, both)


def _batches(counts: np.ndarray, targets: np.ndarray) -> Iterator[tuple[int, np.ndarray | slice]]:
    """Number of neighbours, and at most AT_ONCE of the `targets` (indices) that have so many, batch by batch; a slice
    where they follow one another, so that nothing is copied.
    """
    asked = counts[targets]
    uniform = bool((asked == asked[:1]).all())
    for count in asked[:1] if uniform else np.unique(asked):
        alike = targets if uniform else targets[asked == count]
        for begin in range(0, len(alike), AT_ONCE):
            which = alike[begin : begin + AT_ONCE]
            first, last = int(which[0]), int(which[-1])
            yield int(count), slice(first, last + 1) if last - first == len(which) - 1 else which


def least_count(degree: int) -> int:
    """Number of monomials up to the degree: a support needs as many neighbours."""
    return len(monomials(degree))
