"""A cloud and what is prescribed on it: the check of scenes."""

from __future__ import annotations

import numpy as np

from nlsolve.laws import ConstitutiveLaw
from nlsolve.scenes import Scene
from nlsolve.testing.promises import require, same, shaped


def check_scene(scene: Scene, law: ConstitutiveLaw) -> None:
    """A cloud with an inside and boundary groups that share no node; boundary nodes that start where they are; shapes;
    an exact velocity, where there is one, that agrees with the prescribed one.
    """
    cloud = scene.cloud(law)  # raises for coincident nodes
    members = np.concatenate([np.asarray(group) for group in cloud.boundaries.values()])
    require(len(np.unique(members)) == len(members), "a node belongs to two boundary groups")
    require(((members >= 0) & (members < len(cloud.nodes))).all(), "a boundary group names a node that does not exist")
    require(len(cloud.interior), "no node lies inside")
    held = cloud.nodes[cloud.boundary]
    same(scene.boundary_position(cloud, 0.0), held, float(np.ptp(cloud.nodes)), "boundary_position at t = 0", 1e-14)
    velocity = scene.boundary_velocity(cloud, law, 0.0)
    shaped(velocity, held.shape, "boundary_velocity")
    require(np.isfinite(velocity).all(), "boundary_velocity is not finite")
    require(
        np.isfinite(scene.reference_rate) and scene.reference_rate > 0, "reference_rate must be positive and finite"
    )
    inside = cloud.nodes[cloud.interior]
    force = scene.body_force(inside, law)
    require(force is None or force.shape == inside.shape, "body_force must have the shape of its points")
    contour = scene.contour()
    require(contour is None or (contour.ndim == 2 and contour.shape[1] == 2), "contour() must be a polygon (C, 2)")
    exact = scene.exact(law, cloud.nodes, 0.0)
    if exact is not None:
        require(exact.velocity.shape == cloud.nodes.shape, f"an exact velocity of shape {exact.velocity.shape}")
        size = float(np.abs(exact.velocity).max())
        same(exact.velocity[cloud.boundary], velocity, size, "exact against prescribed velocity on the boundary", 1e-12)
