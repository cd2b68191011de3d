"""What is measured on a solved flow: its error, the reaction of the moving wall, and its fields at the nodes."""

from __future__ import annotations

import numpy as np
import pandas as pd

from nlsolve.contracts.continuum.cloud import Cloud, hat_gradients
from nlsolve.contracts.continuum.discretizer import Discretizer
from nlsolve.contracts.continuum.geometry import Geometry
from nlsolve.contracts.continuum.law import rate_squared, stress
from nlsolve.contracts.continuum.terms import NodeMotion
from nlsolve.flow.momentum import Flow
from nlsolve.series import Array, Indices

NEGLIGIBLE = 1e-6
"""Change of a share of the wall's velocity over a triangle that adds nothing to be seen to the wall's reaction."""


def velocity_error(scene: Geometry, flow: Flow, velocity: Array, time: float) -> dict[str, float]:
    """‖v − v_exact‖₂ / ‖v_exact‖₂ over all nodes and over the interior ones; empty without exact solution."""
    exact = scene.exact(flow.law, flow.cloud.nodes, time)
    if exact is None:
        return {}
    inside = flow.cloud.interior
    return {
        "velocity_error": _relative(velocity, exact.velocity),
        "velocity_error_inside": _relative(velocity[inside], exact.velocity[inside]),
    }


def _relative(value: Array, exact: Array) -> float:
    return float(np.linalg.norm(value - exact) / np.linalg.norm(exact))


def divergence(flow: Flow, velocity: Array) -> float:
    """‖div v‖/‖ε̄‖, root mean squares over the volume points and the strain points; NaN without a volumetric term."""
    dilatation = flow.dilatation_rate(flow.unknowns(velocity))
    if dilatation is None:
        return float("nan")
    squared = rate_squared(flow.strain_rate(flow.unknowns(velocity)))
    return float(np.sqrt(np.mean(dilatation**2) / np.mean(squared)))


def rate_drift(flow: Flow, u: Array) -> float:
    """‖ε̇ − B v‖/‖ε̇‖, root mean squares over the strain points: how far accumulated strain rates are from those of the
    velocity; 0 when they are the same.
    """
    if flow.drift is None:
        return 0.0
    return float(np.sqrt(np.mean(rate_squared(flow.drift.strain)) / np.mean(rate_squared(flow.strain_rate(u)))))


def wall_reaction(
    scene: Geometry, motion: NodeMotion, discretizer: Discretizer, flow: Flow, velocity: Array, time: float
) -> dict[str, float]:
    """Force [N/mm] and torque about the origin [N mm/mm] of the moving wall on the material, per thickness, with their
    relative errors when there is an exact solution; empty without a contour.
    """
    contour, wall = scene.contour(motion), scene.moving_wall
    if contour is None:
        return {}
    u = flow.unknowns(velocity)
    force_x, force_y, torque = (
        _through(contour, discretizer, flow, u)
        if wall is None
        else _at_wall(flow.cloud.boundaries[wall], discretizer, flow, u)
    )
    reaction = {"force_x": force_x, "force_y": force_y, "torque": torque}
    exact = scene.exact(flow.law, flow.cloud.nodes, time)
    if exact is not None and "torque" in exact.quantities:
        reaction["torque_error"] = abs(torque / exact.quantities["torque"] - 1.0)
    if exact is not None and "force_x" in exact.quantities:
        exact_force = np.array([exact.quantities["force_x"], exact.quantities["force_y"]])
        reaction["force_error"] = _relative(np.array([force_x, force_y]), exact_force)
    return reaction


def _through(contour: Array, discretizer: Discretizer, flow: Flow, u: Array) -> tuple[float, float, float]:
    """−∮ σ n ds and −∮ x × σ n ds over the contour (C, 2), where the fields are smooth.

    The quasi-static balance carries both unchanged from the wall to any contour around it.
    """
    edges = np.roll(contour, -1, axis=0) - contour
    middles = contour + 0.5 * edges
    n_ds = np.stack([edges[:, 1], -edges[:, 0]], axis=1)  # outward, the contour running counter-clockwise
    values = discretizer.values(flow.operators.strain.points, middles)
    xx, yy, xy = (values @ component for component in flow.stress_at_points(u))
    pressure = flow.pressure(u)
    if pressure is not None and flow.operators.volumetric is not None:
        there = discretizer.values(flow.operators.volumetric.points, middles) @ pressure
        xx, yy = xx - there, yy - there
    traction = np.stack([xx * n_ds[:, 0] + xy * n_ds[:, 1], xy * n_ds[:, 0] + yy * n_ds[:, 1]], axis=1)
    force_x, force_y = -traction.sum(axis=0)
    torque = -float((middles[:, 0] * traction[:, 1] - middles[:, 1] * traction[:, 0]).sum())
    return float(force_x), float(force_y), torque


def _at_wall(wall: Indices, discretizer: Discretizer, flow: Flow, u: Array) -> tuple[float, float, float]:
    """Σ A σ : B w, the virtual power for w a shift along x, along y, and a turn of the wall, carried into the material
    by φ: 1 on the wall, 0 on other boundaries.

    In a conservative form this is exactly the reaction that balances the forces inside, whatever φ, and φ is 0 inside.
    A strong form has no areas A: its stresses act on the triangles of the cloud, and their balance is only as good as
    the nodes are close. φ = |V|/|V_wall| then weighs it where the material shears. (In a regularised rest of the
    steady spin, n = 0.05, the moment of the stresses can be 12 % from that at the tool.)
    """
    strain, volumetric, nodes = flow.operators.strain, flow.operators.volumetric, flow.cloud.nodes
    strong = strain.areas is None
    carried = _share(wall, flow, u) if strong else np.zeros(len(nodes))
    carried[wall] = 1.0
    x, y = nodes.T
    shift = np.array([np.ones_like(x), np.zeros_like(x)])
    w = carried[:, None] * np.stack([shift.T, shift[::-1].T, np.stack([-y, x], axis=1)])
    motions = w.reshape(3, -1).T
    pressure = flow.pressure(u)
    if strong:
        apart = pressure is not None and volumetric is not None and volumetric.areas is None
        power = _on_triangles(w, carried, discretizer, flow, u, pressure if apart else None)
    else:
        power = (strain.weights() * flow.stress_at_points(u).ravel()) @ (strain.rate @ motions)
    if pressure is not None and volumetric is not None and volumetric.areas is not None:
        power = power - (volumetric.weights() * pressure) @ (volumetric.rate @ motions)
    return float(power[0]), float(power[1]), float(power[2])


def _share(wall: Indices, flow: Flow, u: Array) -> Array:
    """|V|/|V_wall| at all nodes, at most 1, and 0 on all boundaries; 0 everywhere when the wall is at rest."""
    speed = np.linalg.norm(flow.velocity(u), axis=1)
    of_wall = speed[wall].mean()
    speed[flow.cloud.boundary] = 0.0
    return np.minimum(speed / of_wall, 1.0) if of_wall > 0.0 else np.zeros_like(speed)


def _on_triangles(
    w: Array, carried: Array, discretizer: Discretizer, flow: Flow, u: Array, pressure: Array | None
) -> Array:
    """Σ A σ : ∇w for w (3, N, 2) over the triangles of the cloud on which `carried` (N,) changes, A their areas, σ the
    stress in their centres, less `pressure` at the volume points (L,) when it is given.
    """
    nodes = flow.cloud.nodes
    corners = flow.cloud.triangulation
    corners = corners[np.ptp(carried[corners], axis=1) > NEGLIGIBLE]
    centres = nodes[corners].mean(axis=1)
    xx, yy, xy = flow.stress_at_points(u) @ discretizer.values(flow.operators.strain.points, centres).T
    if pressure is not None and flow.operators.volumetric is not None:
        there = discretizer.values(flow.operators.volumetric.points, centres) @ pressure
        xx, yy = xx - there, yy - there
    slopes = np.einsum("wtkc,tkd->wtcd", w[:, corners], hat_gradients(nodes, corners))
    power: Array = slopes[..., 0, 0] @ xx + slopes[..., 1, 1] @ yy + (slopes[..., 0, 1] + slopes[..., 1, 0]) @ xy
    return power


def nodal_fields(
    scene: Geometry, discretizer: Discretizer, flow: Flow, velocity: Array, initial: Cloud, time: float
) -> pd.DataFrame:
    """σ = S − p I, S = 2 μ(ε̄²) ε̇: one row for each node, with its place at t = 0 and now, V, ε̇, μ, S, p, and the
    exact V (columns of `FIELDS`).

    ε̇ and p are taken from the strain points and the volume points to the nodes by the discretizer; μ and S are those of
    the law there. p is the pressure with the penalty's part in it, p − λ tr ε̇; NaN without a volumetric term.
    """
    nodes = flow.cloud.nodes
    u = flow.unknowns(velocity)
    to_nodes = flow.to_nodes(discretizer)
    exx, eyy, exy = rates = np.stack([to_nodes @ component for component in flow.strain_rate(u)])
    sxx, syy, sxy = stress(flow.law, rates)
    at_volume_points, pressure = flow.pressure(u), np.full(len(nodes), np.nan)
    if at_volume_points is not None and flow.operators.volumetric is not None:
        pressure = discretizer.values(flow.operators.volumetric.points, nodes) @ at_volume_points
    exact = scene.exact(flow.law, nodes, time)
    exact_velocity = np.full_like(nodes, np.nan) if exact is None else exact.velocity
    boundary = np.full(len(nodes), "", dtype=object)
    for name, group in initial.boundaries.items():
        boundary[group] = name
    columns: dict[str, object] = {"time": time, "node": np.arange(len(nodes)), "boundary": boundary}
    for names, pair in (
        (("x0", "y0"), initial.nodes),
        (("x", "y"), nodes),
        (("u", "v"), velocity),
        (("exact_u", "exact_v"), exact_velocity),
    ):
        columns |= dict(zip(names, pair.T, strict=True))
    columns |= {"exx": exx, "eyy": eyy, "exy": exy, "rate": np.sqrt(rate_squared(rates))}
    columns |= {"viscosity": flow.law.viscosity(rate_squared(rates)), "sxx": sxx, "syy": syy, "sxy": sxy}
    return pd.DataFrame(columns | {"pressure": pressure})
