"""What is measured on a solved flow: its error, the reaction of the moving wall, its fields at the nodes."""

from __future__ import annotations

import numpy as np
import pandas as pd

from nlsolve.discretizers import Discretizer
from nlsolve.flow import Flow
from nlsolve.laws import rate_squared
from nlsolve.scenes import Cloud, Scene
from nlsolve.series import Array


def velocity_error(scene: Scene, flow: Flow, velocity: Array, time: float) -> dict[str, float]:
    """‖v − v_exact‖₂ / ‖v_exact‖₂ over all nodes and over those inside; empty where the scene has no exact solution."""
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
    squared = rate_squared((flow.operators.strain @ velocity.ravel()).reshape(3, -1))
    return float(np.sqrt(np.mean(dilatation**2) / np.mean(squared)))


def wall_reaction(scene: Scene, discretizer: Discretizer, flow: Flow, velocity: Array, time: float) -> dict[str, float]:
    """Force −∮ σ n ds and torque −∮ x × σ n ds of the moving wall on the material; empty without a contour.

    The quasi-static balance carries both unchanged from the wall to any contour around it, so they are taken where the
    fields are smooth.
    """
    contour = scene.contour()
    if contour is None:
        return {}
    edges = np.roll(contour, -1, axis=0) - contour
    middles = contour + 0.5 * edges
    n_ds = np.stack([edges[:, 1], -edges[:, 0]], axis=1)  # outward, the contour running counter-clockwise
    u = flow.unknowns(velocity)
    values = discretizer.values(flow.operators.strain_points, middles)
    xx, yy, xy = (values @ component for component in flow.stress_at_points(u))
    pressure = flow.pressure(u)
    if pressure is not None and flow.operators.volume_points is not None:
        volumetric = discretizer.values(flow.operators.volume_points, middles) @ pressure
        xx, yy = xx - volumetric, yy - volumetric
    traction = np.stack([xx * n_ds[:, 0] + xy * n_ds[:, 1], xy * n_ds[:, 0] + yy * n_ds[:, 1]], axis=1)
    force_x, force_y = -traction.sum(axis=0)
    torque = -float((middles[:, 0] * traction[:, 1] - middles[:, 1] * traction[:, 0]).sum())
    reaction = {"force_x": float(force_x), "force_y": float(force_y), "torque": torque}
    exact = scene.exact(flow.law, flow.cloud.nodes, time)
    if exact is not None and "torque" in exact.quantities:
        reaction["torque_error"] = abs(torque / exact.quantities["torque"] - 1.0)
    return reaction


def nodal_fields(
    scene: Scene, discretizer: Discretizer, flow: Flow, velocity: Array, initial: Cloud, time: float
) -> pd.DataFrame:
    """A row a node: place at t = 0 and now, velocity, strain rates, exact velocity (columns of `FIELDS`)."""
    nodes = flow.cloud.nodes
    strain_rate = (flow.operators.strain @ velocity.ravel()).reshape(3, -1)
    to_nodes = discretizer.values(flow.operators.strain_points, nodes)
    exx, eyy, exy = at_nodes = np.stack([to_nodes @ component for component in strain_rate])
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
    return pd.DataFrame(columns | {"exx": exx, "eyy": eyy, "exy": exy, "rate": np.sqrt(rate_squared(at_nodes))})
