"""The columns of the result tables, each with its meaning and unit: the one description of what nlsolve measures."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

REPORTED: dict[str, str] = {
    "reported_iterations": "iterations that the library behind a method says it took",
    "reported_residuals": "residuals that it says it evaluated",
    "reported_jacobians": "Jacobians that it says it evaluated",
    "reported_factorizations": "set-ups of its preconditioner, here K*, that it says it asked for",
    "reported_triangular_solves": "solves with it that it says it asked for",
}
"""What a library says of its own work, to be held against the counts beside it; NaN where it says nothing."""

RUNS: dict[str, str] = {
    "case": "identity of the case: a digest of its validated components",
    "status": "how the case ended, in a word or two",
    "message": "how the case ended, in a sentence",
    "said_converged_but_is_not": "solves in which the method, or a stopping test other than that of residuals, said "
    "converged of a state whose residual says otherwise",
    "said_failed_but_is": "solves in which the method said failed of a state that is a solution",
    "blame_x": "of a failed solve: the node where the last residual is largest, x [mm]",
    "blame_y": "the same, y [mm]",
    "blame_rate": "strain rate ε̄ nearest to that node [1/s]",
    "blame_regularized": "share of the strain points with ε̄ < ε₀ at that state",
    "blame_unknown": "of a failed solve of a system: the number of the unknown whose equation is farthest from solved",
    "nodes": "N, nodes of the cloud",
    "unknowns": "U, unknown velocity components, or unknowns of a system",
    "smallest_spacing": "smallest distance between two nodes at t = 0 [mm]",
    "cloud_quality": "moving nodes: least distance of a node to its nearest over that at t = 0, over the march",
    "increments": "time steps completed; 1 for a steady state",
    "time": "time reached [s]",
    "iterations": "iterations or series used by the method in all increments",
    "pressure_iterations": "iterations of the pressure in all increments, where the scene asks for a divergence",
    "branches": "tangents K* factorised during the march (the 2015 paper's NIM)",
    "validity_time": "how long the first tangent of the march served [s]",
    "factorizations": "matrices factorised during the march",
    "triangular_solves": "pairs of triangular solves during the march",
    "jacobians": "Jacobians assembled during the march",
    "residuals": "residuals evaluated by the method during the march",
    "series_orders": "Taylor coefficients of the residual computed during the march",
    "series_terms": "sum of their orders j: order j convolves j earlier terms, so this is how their cost grows",
    "expansions": "of the residuals, those that began a series",
    "matrix_products": "products with an assembled Jacobian during the march",
    **REPORTED,
    "start_factorizations": "matrices factorised on the way to the first state",
    "start_triangular_solves": "pairs of triangular solves on the way to the first state",
    "start_residuals": "residuals evaluated on the way to the first state",
    "seconds": "processor time inside the method: its own work and all it asked for [s]",
    "seconds_factorization": "of it, factorising [s]",
    "seconds_triangular_solve": "of it, triangular solves [s]",
    "seconds_jacobian": "of it, assembling Jacobians [s]",
    "seconds_residual": "of it, residuals [s]",
    "seconds_series": "of it, series coefficients [s]",
    "seconds_own": "of it, the method's own work: norms, mixing, extrapolation [s]",
    "seconds_most": "the same as `seconds` in the slowest of several rounds [s]",
    "seconds_predicted": "the same by the cost model: counts times unit costs, and own work as other linear solvers "
    "saw it [s]",
    "rounds": "how often the case was timed; the seconds are those of its fastest round",
    "clock": "what the seconds are told by: wall, or processor, which other programs do not keep waiting",
    "unit.residual": "measured on the last problem of the case: one residual [s]",
    "unit.expansion": "the same: beginning a series [s]",
    "unit.jacobian": "the same: one Jacobian [s]",
    "unit.matrix_product": "the same: one product with a Jacobian [s]",
    "unit.factorization": "the same: one factorisation, its ordering known [s]",
    "unit.triangular_solve": "the same: one pair of triangular solves [s]",
    "unit.series_order": "the same: a Taylor coefficient of order j costs this … [s]",
    "unit.series_term": "… and j times this [s]",
    "seconds_operators": "building operators, the same for every method and not in `seconds` [s]",
    "seconds_start": "reaching the first state [s]",
    "seconds_all": "operators, first state and march: what the result costs in all [s]",
    "ordering": "column ordering the linear solver used",
    "fill": "entries stored in the last factors",
    "factor_solve_ratio": "measured time of one factorisation over one pair of triangular solves",
    "condition": "estimate of ‖K*‖₁ ‖K*⁻¹‖₁ for the last tangent, where the linear solver can tell",
    "residual_norm": "largest relative residual accepted in any increment, asked for outside the method",
    "divergence": "‖div V‖/‖ε̄‖ over volume points and strain points at the end, with a volumetric term",
    "velocity_error": "relative ℓ² error of the velocities of all nodes at the end, where there is an exact solution",
    "velocity_error_inside": "the same over the interior nodes alone, whose velocities are not given",
    "velocity_error_estimate": "an estimate of it without an exact solution: how much one Newton step in another "
    "discretisation of the same nodes (section `error_estimator`) would change these velocities",
    "reference_error": "relative ℓ² difference of the velocities of all nodes at the end from those of the case that "
    "the study makes its reference",
    "root_error": "‖u − root‖/‖root‖ for the known root nearest to where a system ended (‖u‖ for the root 0)",
    "root_singular": "true for a system whose Jacobian is singular at a known root: a small residual says little there",
    "torque": "torque of the moving wall on the material per mm of thickness [N mm/mm]",
    "torque_error": "relative error of the torque against the exact solution",
    "force_x": "force of the moving wall on the material per mm of thickness, x [N/mm]",
    "force_y": "the same, y [N/mm]",
    "force_error": "‖force − exact force‖/‖exact force‖, where the exact solution has a force",
    "audit.inertia": "‖ρ ∂V/∂t‖/‖∇S‖ over the last increment (on moving nodes ρ dV/dt), where inertia is left out",
    "audit.convection": "‖ρ (V·∇) V‖/‖∇S‖ at the end, where convection is left out and nodes are fixed",
    "audit.compressibility": "‖div V‖/‖ε̄‖ at the end; without a volumetric term from gradients at the nodes",
    "audit.regularization": "share of the strain points with ε̄ < 10 ε₀, for a law with a regularization",
    "audit.regularization_stress": "share of Σ |S| that these strain points carry",
    "audit.regularization_strain": "share of Σ ε̄ that they carry; about three times this is the error inside it makes",
    "audit.residual": "‖R‖ over the size of the stresses' forces that cancel in it",
    "audit.balance": "‖div S + f − ρ dV/dt‖/‖∇S‖ by operators other than those solved with, where no pressure acts",
    "audit.resolution": "share of the change of V between neighbouring inner nodes that its gradients do not explain",
    "audit.heating": "largest adiabatic heating S:ε̇/(ρ c_p) over the time reached, or a time 2π/reference rate [K]",
    "doubt": "what the audits, or a system's roots, put in doubt, and the way out; empty when nothing",
}
"""`runs`: a row a case, whatever its ending. Behind these stand all parameters of the case, dotted ("solver.order")."""

DIAGNOSTICS: dict[str, str] = {
    "operator": "what the weights are for: strain, force, volume",
    "targets": "places the weights belong to",
    "smallest_support": "fewest neighbours of a place",
    "largest_support": "most neighbours of a place",
    "grown": "places whose support had to grow to become unisolvent and balanced",
    "balance": "smallest ratio of the least to the largest singular value of a support's local system",
    "reproduction_error": "largest error of derivatives of polynomials of the degree, scaled by the weights",
    "largest_weight": "largest sum of |weights| times the distance of neighbours: amplification of rounding and noise",
}
"""`nlsolve diagnose`: a row an operator of a cloud."""

STEPS: dict[str, str] = {
    "case": "identity of the case",
    "increment": "number of the time step; 0 for a steady state",
    "time": "time at the end of the increment [s]",
    "step": "number of the step within the increment; 0 is the state the increment began with",
    "accepted": "true on the last step of a finished increment",
    "branch": "tangents factorised so far in the march",
    "triangular_solves": "pairs of triangular solves so far in the march",
    "residual_norm": "relative residual at the step",
    "difference": "relative difference from the step before, in the norm of the stopping test",
    "range": "a_max of the last series computed for the step",
    "singularity": "distance of the nearest singularity of the last series, as a part of its path, from its last terms",
    "limited_by": "what limited that range: end of path, the range rule, pole (of a Padé), order (the highest) or cost "
    "(a new branch is cheaper than more orders)",
    "length": "step length of the line search, or the part of the path a series advanced",
    "contraction": "residual norm over that of the step before, as the refresh rule is told (newton-krylov: per inner "
    "iteration; anm: per order; petsc-snes, kinsol: per solve with K*; scipy-root: per value of R)",
    **REPORTED,
    "seconds": "time inside the method so far in the march [s]",
    "probe_x": "place of the probe node, x [mm] (accepted steps)",
    "probe_y": "the same, y [mm]",
    "probe_u": "velocity of the probe node, x [mm/s]",
    "probe_v": "the same, y [mm/s]",
}
"""`steps`: a row an iteration or series, in order. A column that does not apply to a method or scene holds NaN. Behind
these stand the notes of a method for which there is no column, as "note.<name>".
"""

NOTE = "note."


def step_columns(notes: Mapping[str, Any]) -> dict[str, Any]:
    """What a method notes of a step, by columns of `steps`: those described there, or "note.<name>"."""
    return {name if name in STEPS else f"{NOTE}{name}": value for name, value in notes.items()}


FIELDS: dict[str, str] = {
    "case": "identity of the case",
    "time": "time of the snapshot [s]",
    "node": "number of the node",
    "boundary": "name of the boundary group of the node; empty inside",
    "x0": "place of the node, and of its marker, at t = 0, x [mm]",
    "y0": "the same, y [mm]",
    "x": "place, x [mm]",
    "y": "the same, y [mm]",
    "marker_x": "place of the marker that started at the node, x [mm]; NaN without markers, or once it has left",
    "marker_y": "the same, y [mm]",
    "u": "velocity, x [mm/s]",
    "v": "the same, y [mm/s]",
    "exx": "strain rate ε̇xx [1/s]",
    "eyy": "strain rate ε̇yy [1/s]",
    "exy": "strain rate ε̇xy [1/s]",
    "rate": "equivalent strain rate ε̄ [1/s]",
    "exact_u": "exact velocity, x [mm/s]; NaN where the scene has none",
    "exact_v": "the same, y [mm/s]",
}
"""`fields`: a row a node and recorded time."""
