"""Collocation by radial basis functions on local supports (RBF-FD)."""

from __future__ import annotations

from typing import ClassVar, Literal, Self

import numpy as np
from pydantic import Field, model_validator

from nlsolve.plugin import Cloud, ConstitutiveLaw, SolveError, Status, local_index
from nlsolve_discretizers.collocation import Collocation, least_count
from nlsolve_discretizers.weights.least_squares import Derivatives
from nlsolve_discretizers.weights.lists import Lists
from nlsolve_discretizers.weights.radial import interpolate, kernel
from nlsolve_discretizers.weights.supports import Supports

ILL_CONDITIONED = 1e-14  # reciprocal condition number of a local system whose solution is noise
AT_BOUNDARIES = 1.5  # neighbours of a target near a boundary node, over those of the others

LEAST_STRONG = 0.25
"""Index below which the default form is conservative. Weights that interpolate leave the strong form's tangent on the
steady spin with eigenvalues of negative real part (3 at n = 0.1324 on 1,436 nodes, where moving least squares have
none), of which Newton's method stagnates: on every cloud tried at n = 0.05, on some at n = 0.1324, on none at n = 0.3.
"""


class RadialBasis(Collocation):
    """Kernels and polynomials that interpolate the neighbours: weights for strains, forces and values.

    phs, r^power, has no shape to tune; gaussian exp(−ε² r²), multiquadric √(1 + ε² r²) and wendland (1 − ε r)⁴ (4 ε r
    + 1) have ε = shape over the spacing of the support. The flatter a kernel, the worse the local systems are
    conditioned: past working precision they are refused, not solved.
    """

    kind: Literal["rbf"] = "rbf"
    kernel: Literal["phs", "gaussian", "multiquadric", "wendland"] = Field("phs", description="the radial function")
    power: Literal[3, 5, 7] = Field(3, description="of the distance, in polyharmonic splines")
    shape: float = Field(0.3, gt=0, description="ε times the spacing, of the other kernels")
    form: Literal["strong", "conservative"] | None = Field(
        None,
        description=f"how stresses act on the nodes; absent: conservative for n < {LEAST_STRONG:g}, else strong",
    )
    support: int | None = Field(None, ge=3, description="neighbours inside; absent: twice the number of polynomials")

    weak: ClassVar[float] = ILL_CONDITIONED

    @model_validator(mode="after")
    def _enough_neighbours(self) -> Self:
        least = least_count(self.degree)
        if self.support is not None and self.support < least:
            raise ValueError(
                f"support = {self.support}: polynomials of degree {self.degree} need at least {least} points"
            )
        return self

    def for_law(self, law: ConstitutiveLaw, rate: float) -> RadialBasis:
        """The form for the local index of the law, where none is given."""
        if self.form is not None:
            return self
        return self.with_(form="conservative" if local_index(law, rate) < LEAST_STRONG else "strong")

    def advice(self, law: ConstitutiveLaw, rate: float) -> str:
        """To leave the form open, where a strong one was asked for at an index for which it has no use."""
        index = local_index(law, rate)
        if self.form != "strong" or index >= LEAST_STRONG:
            return ""
        return (
            f"the strong form of radial basis functions has an indefinite tangent at an index of {index:g}: leave "
            'discretizer.form out, or set it to "conservative"'
        )

    def neighbour_count(self, role: str) -> int:
        """As many for every role."""
        return self.support or 2 * least_count(self.degree)

    def supports(
        self, sources: np.ndarray, targets: np.ndarray, role: str, cloud: Cloud | None, lists: Lists | None = None
    ) -> Supports:
        """The nearest sources by count, and half as many more for a target whose nearest boundary node lies within
        half the radius of its support.
        """
        count = self.neighbour_count(role)
        supports = Supports.nearest(sources, targets, count, self.balanced, lists)
        if cloud is None:
            return supports
        wall = Supports.nearest(cloud.nodes[cloud.boundary], targets, 1)
        near = np.flatnonzero(
            np.linalg.norm(cloud.nodes[cloud.boundary][wall.index[:, 0]] - targets, axis=1) < 0.5 * supports.radius
        )
        larger = Supports.nearest(sources, targets[near], int(AT_BOUNDARIES * count), self.balanced)
        return supports.replaced(near, larger)

    def local_weights(
        self, places: np.ndarray, radius: np.ndarray, derivatives: Derivatives
    ) -> tuple[np.ndarray, np.ndarray]:
        """Weights by interpolation; the quality of a support is the reciprocal condition number of its local system."""
        radius_in_spacings = (places.shape[1] / np.pi) ** 0.5
        phi = kernel(self.kernel, self.power, self.shape * radius_in_spacings)
        return interpolate(places, radius, self.degree, derivatives, phi)

    def refusal(self, count: int, place: np.ndarray, quality: float) -> SolveError | None:
        """An error (ill conditioned) if the local system cannot be solved in working precision."""
        if quality >= ILL_CONDITIONED:
            return None
        way_out = "widen the supports" if self.kernel == "phs" else "raise discretizer.shape or use the kernel phs"
        return SolveError(
            Status.ILL_CONDITIONED,
            f"the kernel {self.kernel!r} on the {count} neighbours of the point ({place[0]:.6g}, {place[1]:.6g}) has a "
            f"condition number of {1.0 / max(quality, 1e-300):.0e}: {way_out}",
        )
