"""Σ_q A_q ∇φ_i(x_q) = 0 for every interior node i : gradients that obey the discrete divergence theorem.

With S = −Bᵀ A a stress that is constant then exerts no force (patch test), what leaves one node enters its neighbours,
and the residual is the gradient of the dissipation potential. Gradients of moving least squares or radial functions
miss the theorem on any areas A. They are changed by the least amount, Σ_q |δ_q|²_(1/w), that restores it and keeps
linear velocities exact; the multipliers of the F conditions follow from one symmetric sparse system for each direction.
Chen, Wu, Yoon & You (2001) for the theorem, Chen, Hillman & Rüter (2013) for corrections of test gradients.
"""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp
from scipy.sparse.linalg import splu

from nlsolve.plugin import Cloud, SolveError, Status
from nlsolve_discretizers.weights.assembly import Gradient
from nlsolve_discretizers.weights.least_squares import weight_function

NEARNESS = 4.0
"""Shape of the weights w: changes fall on the nearest nodes, where they cost least accuracy (measured: 3.5 to 5)."""

LARGEST_CORRECTION = 2.0
"""Largest correction, relative to the gradients. Usual supports need 0.04 to 1, those without freedom 6 to 80."""


def conserving(cloud: Cloud, points: np.ndarray, areas: np.ndarray, gradient: Gradient) -> Gradient:
    """The corrected gradient at `points` (M, 2) with `areas` (M,) [mm²].

    Raises SolveError (bad cloud) when some interior node is not felt by enough points to be balanced, and (ill
    conditioned) when the correction is larger than what it corrects.
    """
    near, n, free = gradient.near, len(cloud.nodes), cloud.interior
    felt = (gradient.dx != 0.0) | (gradient.dy != 0.0)  # zero weights only fill up a support
    offsets = np.where(felt[..., None], cloud.nodes[near] - points[:, None], 0.0)
    radius = np.linalg.norm(offsets, axis=2).max(axis=1)
    offsets /= radius[:, None, None]
    change = _projector(offsets, felt) * (areas / radius**2)[:, None, None]  # δ_q = change_q λ, λ at the neighbours
    unknown = np.full(n, -1)
    unknown[free] = np.arange(len(free))
    rows, columns = np.broadcast_arrays(unknown[near][:, :, None], unknown[near][:, None, :])
    inner = (rows >= 0) & (columns >= 0)
    system = sp.csc_array(
        ((areas[:, None, None] * change)[inner], (rows[inner], columns[inner])), shape=(len(free), len(free))
    )
    try:
        factors = splu(system, permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=1e-3, options={"SymmetricMode": True})
    except RuntimeError as error:
        raise SolveError(
            Status.BAD_CLOUD, "the gradients cannot be made conservative on this cloud: widen the supports"
        ) from error

    def balanced(weights: np.ndarray) -> np.ndarray:
        for _ in range(2):  # the second time for rounding
            defect = np.bincount(near.ravel(), (areas[:, None] * weights).ravel(), n)[free]
            multiplier = np.zeros(n)
            multiplier[free] = factors.solve(defect)
            weights = weights - np.einsum("mkl,ml->mk", change, multiplier[near])
        return weights

    corrected = Gradient(near, np.stack([balanced(weights) for weights in gradient.both]))
    part = float(np.linalg.norm(corrected.both - gradient.both)) / float(np.linalg.norm(gradient.both))
    if not part <= LARGEST_CORRECTION:
        raise SolveError(
            Status.ILL_CONDITIONED,
            f"gradients that conserve are {part:.0%} away from the accurate ones: the supports of "
            f"{int(felt.sum(axis=1).min())} neighbours leave them no freedom; widen discretizer.support",
        )
    return corrected


def _projector(offsets: np.ndarray, felt: np.ndarray) -> np.ndarray:
    """w − w P (Pᵀ w P)⁻¹ Pᵀ w, shape (M, k, k): changes of weights that leave linear fields as they are."""
    w = felt * weight_function("gaussian", np.linalg.norm(offsets, axis=2), NEARNESS)
    linear = np.concatenate([np.ones((*offsets.shape[:2], 1)), offsets], axis=2)
    weighted = w[..., None] * linear
    gram = linear.transpose(0, 2, 1) @ weighted
    projector = -(weighted @ np.linalg.solve(gram, weighted.transpose(0, 2, 1)))
    diagonal = np.arange(w.shape[1])
    projector[:, diagonal, diagonal] += w
    return projector
