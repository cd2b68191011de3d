"""How large is what a scene left out? Every missing term, estimated from the solution itself.

    ρ ∂V/∂t, ρ (V·∇) V beside ∇S      div V beside ε̄      ε₀ beside ε̄      h ∇∇V beside ∇V      S:ε̇/(ρ c_p) beside T
    V beside the V of an enriched cloud

What law, scene and numbers claim is held against the solution too (`nlsolve.flow.claims`).

N nodes, M strain points. An audit above its limit names the switch to turn on. A term that the scene keeps has no
audit (NaN). Every audit above its limit puts the result in doubt, except that of heating.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from nlsolve.contracts.continuum.law import CONTRACTION, rate_squared, stress
from nlsolve.contracts.status import SolveError
from nlsolve.flow.accuracy.estimate import NOTHING_TO_COMPARE, Comparison
from nlsolve.flow.accuracy.holes import largest_hole
from nlsolve.flow.accuracy.moments import largest_moment
from nlsolve.flow.claims.exact import disagreement
from nlsolve.flow.claims.finding import Finding
from nlsolve.flow.claims.law import falling_stress, gained_power
from nlsolve.flow.claims.units import strange_sizes
from nlsolve.flow.momentum import Flow
from nlsolve.flow.observables import divergence
from nlsolve.flow.state import FlowParts
from nlsolve.results.verdicts import ACCEPTED
from nlsolve.series import Array

HEAT_CAPACITY = 8.6e8
"""c_p of aluminium [mm²/(s² K)]."""

NEAR_REGULARIZATION = 10.0
"""ε₀ acts where ε̄ < 10 ε₀: at that rate it changes ε̄² by a hundredth."""

NEIGHBOURS = 6

SAFETY = 1.5
"""The estimate of an error times this factor should cover the error (on such factors Roache 1994). Over the cases of
studies/discretizers.toml the estimate is never below 0.68 of the error inside; extremes.toml was known when the factor
was chosen.
"""

WIDEST = 1.5
"""A hole in units of the spacing around it. Of 200 shipped clouds, up to a jitter of 0.49, two cavities with strongly
graded corners have 1.1 and 1.3, all others less than 1.05. An empty circle of four spacings' radius away from walls has
about 2.
"""

FALLING = 1e-9
"""The part by which rounding may let a constant stress fall."""

FAR = 5.0
"""Error over its estimate above which the exact solution is doubted, where nothing else is in doubt. Of 134 cases of
benchmarks/claims.py 75 were not in doubt, at a ratio of at most 3.5 to an estimate by another discretisation.
"""

ROUNDING = 1e-6
"""A ‖∇S‖ smaller than this times |S| over the size of the cloud is the rounding of a uniform stress."""


@dataclass(frozen=True)
class Limit:
    """The limit of an audit.

    largest : the largest value that passes.
    sentence : what a larger value means, and the way out.
    doubt : whether a larger value puts the result in doubt.
    always : whether the command line prints values that pass, too.
    """

    largest: float
    sentence: str
    doubt: bool = True
    always: bool = True


LIMITS: dict[str, Limit] = {
    "audit.inertia": Limit(0.05, "inertia is not negligible: set physics.inertia = true"),
    "audit.convection": Limit(0.05, "convection is not negligible: set physics.convection = true"),
    "audit.compressibility": Limit(
        0.05, "the material is compressed: raise the penalty, or set physics.divergence_tolerance"
    ),
    "audit.regularization_strain": Limit(0.02, "the regularization rules much of the flow: lower law.regularization"),
    "audit.residual": Limit(1e-5, "the residual is not small beside the stresses: tighten stop.tolerance"),
    "audit.balance": Limit(0.2, "the stresses are not in balance between the points: choose a finer or evener spacing"),
    "audit.moment": Limit(
        0.07,
        "the moments of the stresses are out of balance: choose a finer or evener spacing, or check the discretizer",
        always=False,
    ),
    "audit.resolution": Limit(1 / 3, "the nodes are too far apart for the layers: choose a finer spacing there"),
    "velocity_error_estimate": Limit(
        ACCEPTED / SAFETY,
        "a solution with more nodes differs: choose a finer or evener spacing, or a higher penalty",
    ),
    "audit.hole": Limit(WIDEST, "a part of the cloud has no nodes: add nodes there", always=False),
    "audit.gained_power": Limit(0.0, "the law gives off power, S:ε̇ < 0: make its viscosity positive", always=False),
    "audit.falling_stress": Limit(
        FALLING, "the stress of the law falls while the rate grows: choose a law whose stress grows", always=False
    ),
    "audit.exact": Limit(
        FAR,
        "the exact solution is far from one whose error is estimated as small: check it, or choose a finer spacing",
        always=False,
    ),
    "audit.units": Limit(
        1.0, "the numbers look like SI units: give lengths in mm, stresses in MPa, densities in t/mm³", always=False
    ),
    "audit.heating": Limit(50.0, "temperature is constant here: the material would heat up and soften", doubt=False),
}


def audit(
    parts: FlowParts,
    flow: Flow,
    velocity: Array,
    change: Array | None,
    time: float,
    estimate: Callable[[], Comparison] = lambda: NOTHING_TO_COMPARE,
    error: float = float("nan"),
) -> dict[str, Any]:
    """The columns `audit.…`, `…_error_estimate` and `doubt` of a solved flow with `velocity` (N, 2).

    change : ∂V/∂t (N, 2) [mm/s²] over the last increment, dV/dt for moving nodes; None for a steady scene.
    time : time that the march has reached [s]; 0 for a steady scene.
    estimate : returns the velocity beside a better one, by other solutions; NaN without one.
    error : of the velocity inside, against the exact solution; NaN without one.
    When an operator cannot be built, the `doubt` has the reason, and only the claims of law and numbers are audited.
    """
    strain_rate = flow.strain_rate(flow.unknowns(velocity))
    claims = {
        "audit.gained_power": gained_power(parts.law, flow.operators.strain.points, strain_rate),
        "audit.falling_stress": falling_stress(parts.law, strain_rate),
        "audit.hole": largest_hole(flow.cloud),
        "audit.units": strange_sizes(parts.law, parts.physics.density, parts.scene.reference_rate, flow.cloud),
    }
    try:
        gradient = parts.discretizer.gradient(flow.cloud)
        to_nodes = flow.to_nodes(parts.discretizer)
        slopes = np.stack([derivative @ velocity for derivative in gradient])  # (2, N, 2): ∂/∂x and ∂/∂y of u, v
        force = _force(parts, flow, velocity, change, slopes)
        claims["audit.moment"] = _moment(parts, flow, velocity, force)
    except SolveError as refusal:
        found = {name: claim.value for name, claim in claims.items()}
        return found | {"doubt": _doubt(found, claims, f"the audits could not be made: {refusal.detail}")}
    estimated, doubts = NOTHING_TO_COMPARE, []
    try:
        estimated = estimate()
    except SolveError as refusal:
        doubts.append(f"the error could not be estimated: {refusal.detail}")
    stress_slopes = _stress_slopes(flow, strain_rate, gradient, to_nodes)
    found = {
        **_accelerations(parts, flow, velocity, change, slopes, _size(stress_slopes)),
        "audit.compressibility": _compressibility(flow, velocity, slopes),
        **_regularization(flow, strain_rate),
        "audit.residual": _residual(flow, velocity),
        "audit.balance": _balance(flow, velocity, force, stress_slopes),
        "audit.resolution": _resolution(flow, velocity, slopes),
        "velocity_error_estimate": estimated.relative,
        "worst_error_estimate": estimated.worst,
        **{name: claim.value for name, claim in claims.items()},
        "audit.exact": float("nan"),
        "audit.heating": _heating(parts, flow, strain_rate, time),
    }
    if not _doubt(found, claims, *doubts):  # an error that another audit explains does not belie the exact solution
        claims["audit.exact"] = disagreement(parts.scene.called(), error, estimated.relative)
        found["audit.exact"] = claims["audit.exact"].value
    return found | {"doubt": _doubt(found, claims, *doubts)}


def _doubt(found: Mapping[str, float], claims: Mapping[str, Finding], *others: str) -> str:
    """The sentences of what is above its limit: those of the claims name places and values."""
    above = [name for name, limit in LIMITS.items() if limit.doubt and found.get(name, np.nan) > limit.largest]
    return "; ".join([*others, *(claims[name].sentence if name in claims else LIMITS[name].sentence for name in above)])


def _ratio(above: float | np.floating[Any], below: float | np.floating[Any]) -> float:
    return float(above / below) if below > 0.0 else float("nan")


def _stress_slopes(flow: Flow, strain_rate: Array, gradient: tuple[Any, Any], to_nodes: Any) -> Array:
    """∂S/∂x and ∂S/∂y at the interior nodes, (2, 3, F), from values of S there and gradients of the nodes."""
    at_nodes = stress(flow.law, strain_rate) @ to_nodes.T
    return np.stack([at_nodes @ derivative.T for derivative in gradient])[..., flow.cloud.interior]


def _size(stress_slopes: Array) -> float:
    """‖∇S‖₂: the size of div S before its parts and the pressure cancel."""
    return float(np.sqrt(np.einsum("c,acn,acn", CONTRACTION, stress_slopes, stress_slopes)))


def _force(parts: FlowParts, flow: Flow, velocity: Array, change: Array | None, slopes: Array) -> Array | None:
    """f − ρ dV/dt at the nodes, (N, 2) [N/mm³]: what the scene keeps beside stresses and pressure; None: nothing."""
    force = parts.scene.body_force(flow.cloud.nodes, flow.law, parts.physics)
    if parts.physics.inertia and change is not None:
        force = (0.0 if force is None else force) - parts.physics.density * change
    if parts.physics.convection:
        carried = np.einsum("na,anc->nc", velocity, slopes)
        force = (0.0 if force is None else force) - parts.physics.density * carried
    return force


def _balance(flow: Flow, velocity: Array, force: Array | None, stress_slopes: Array) -> float:
    """‖div S + f − ρ dV/dt‖₂ / ‖∇S‖₂ over the interior nodes, where no pressure acts: the solved balance, evaluated
    by operators that had no part in the solve. Steady spin: up to 0.17 where the error inside is below 5 %.
    """
    if flow.dilatation_rate(flow.unknowns(velocity)) is not None:
        return float("nan")
    inside = flow.cloud.interior
    (xx_x, _, xy_x), (_, yy_y, xy_y) = stress_slopes
    total = np.stack([xx_x + xy_y, xy_x + yy_y], axis=1)
    if force is not None:
        total = total + force[inside]
    stresses = np.abs(flow.stress_at_points(flow.unknowns(velocity))).max()
    uniform = ROUNDING * stresses * np.sqrt(len(inside)) / np.ptp(flow.cloud.nodes, axis=0).max()
    return _ratio(np.linalg.norm(total), max(_size(stress_slopes), uniform))


def _moment(parts: FlowParts, flow: Flow, velocity: Array, force: Array | None) -> Finding:
    """The balance of moments on discs, with values between the points as the discretizer takes them there.

    Even cases of benchmarks/error_estimates.py: up to 0.053 where the error is below 5 %.
    """
    stresses = flow.stress_at_points(flow.unknowns(velocity))
    values, points, nodes = parts.discretizer.values, flow.operators.strain.points, flow.cloud.nodes
    return largest_moment(
        flow.cloud,
        lambda places: stresses @ values(points, places).T,
        None if force is None else lambda places: values(nodes, places) @ force,
    )


def _accelerations(
    parts: FlowParts, flow: Flow, velocity: Array, change: Array | None, slopes: Array, stress_slopes: float
) -> dict[str, float]:
    """‖ρ ∂V/∂t‖/‖∇S‖ and ‖ρ (V·∇) V‖/‖∇S‖ over the interior nodes, each when the scene has no such term."""
    inside = flow.cloud.interior
    missing = {}
    if change is not None and not parts.physics.inertia:
        missing["audit.inertia"] = change
    if not parts.motion.moving and not parts.physics.convection:
        missing["audit.convection"] = np.einsum("na,anc->nc", velocity, slopes)
    nothing = {"audit.inertia": np.nan, "audit.convection": np.nan}
    return nothing | {
        name: _ratio(parts.physics.density * np.linalg.norm(acceleration[inside]), stress_slopes)
        for name, acceleration in missing.items()
    }


def _compressibility(flow: Flow, velocity: Array, slopes: Array) -> float:
    """‖div V‖/‖ε̄‖, at the volume points with a volumetric term, at the interior nodes without one."""
    if flow.dilatation_rate(flow.unknowns(velocity)) is not None:
        return divergence(flow, velocity)
    (exx, vx), (uy, eyy) = slopes[:, flow.cloud.interior].transpose(0, 2, 1)
    rate = np.sqrt(rate_squared(np.stack([exx, eyy, 0.5 * (uy + vx)])))
    return _ratio(np.linalg.norm(exx + eyy), np.linalg.norm(rate))


def _residual(flow: Flow, velocity: Array) -> float:
    """‖R‖₂ / ‖|S| |s|‖₂. A stopping test is relative to all forces that cancel; where a large λ makes those of the
    penalty by far the largest, it can be met while the stresses are not yet in balance.
    """
    u = flow.unknowns(velocity)
    forces = abs(flow.operators.strain.force) @ np.abs(flow.stress_at_points(u)).ravel()
    return _ratio(np.linalg.norm(flow.residual(u)), np.linalg.norm(forces))


def _regularization(flow: Flow, strain_rate: Array) -> dict[str, float]:
    """Shares of the strain points with ε̄ < 10 ε₀, of Σ |S| and of Σ ε̄ that they carry.

    The share of Σ ε̄ measures the effect of ε₀ on velocities: shares of 0.002, 0.02 and 0.07 go with changes of the
    steady spin inside by 0.9 %, 8 % and 22 %, whatever the share of the stress.
    """
    names = ("audit.regularization", "audit.regularization_stress", "audit.regularization_strain")
    regularization = flow.law.regularization_rate
    if regularization is None:
        return dict.fromkeys(names, np.nan)
    rate = np.sqrt(rate_squared(strain_rate))
    slow = rate < NEAR_REGULARIZATION * regularization
    carried = (np.ones_like(rate), np.sqrt(CONTRACTION @ stress(flow.law, strain_rate) ** 2), rate)
    return {name: _ratio(part[slow].sum(), part.sum()) for name, part in zip(names, carried, strict=True)}


def _resolution(flow: Flow, velocity: Array, slopes: Array) -> float:
    """‖V_j − V_i − ½ (∇V_i + ∇V_j)·(x_j − x_i)‖ / ‖V_j − V_i‖ over pairs of neighbouring interior nodes.

    Large where a layer is thinner than the spacing, and where velocities alternate from node to node unseen by their
    gradients. Steady spin by moving least squares, eight clouds and forms, four indices: below 0.23 where the error
    inside is below 2 %, above 0.5 where it is above 9 %. A wrong velocity that is smooth goes unnoticed.
    """
    nodes = flow.cloud.nodes
    near = flow.cloud.tree.query(nodes, min(NEIGHBOURS + 1, len(nodes)))[1][:, 1:]
    i, j = np.repeat(np.arange(len(nodes)), near.shape[1]), near.ravel()
    inner = ~(flow.cloud.on_boundary[i] | flow.cloud.on_boundary[j])
    i, j = i[inner], j[inner]
    change = velocity[j] - velocity[i]
    explained = 0.5 * np.einsum("ea,aec->ec", nodes[j] - nodes[i], slopes[:, i] + slopes[:, j])
    return _ratio(np.linalg.norm(change - explained), np.linalg.norm(change))


def _heating(parts: FlowParts, flow: Flow, strain_rate: Array, time: float) -> float:
    """max S:ε̇/(ρ c_p) · time [K]; in a steady scene the time is 2π/reference rate (one turn of a tool)."""
    power = CONTRACTION @ (stress(flow.law, strain_rate) * strain_rate)
    return float(power.max() / (parts.physics.density * HEAT_CAPACITY)) * (
        time or 2.0 * np.pi / parts.scene.reference_rate
    )
