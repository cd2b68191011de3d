"""The columns of the result frames, each with its meaning, unit and symbol."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any

from nlsolve.registry.problems import did_you_mean, moved_name


@dataclass(frozen=True)
class Column:
    """A column of a result frame.

    unit : such as "mm/s"; empty for words, counts and ratios.
    symbol : what an axis calls the column, in TeX mathematics or in words; empty: its name with spaces.
    relative_error : whether it is a relative error, which people read in percent.
    timed : whether it was read from a clock while the case ran.
    figures : significant figures of it that a paper prints.
    """

    name: str
    meaning: str
    unit: str = ""
    symbol: str = ""
    relative_error: bool = False
    timed: bool = False
    figures: int = 3


def _by_name(*columns: Column) -> Mapping[str, Column]:
    return MappingProxyType({column.name: column for column in columns})


REPORTED = _by_name(
    Column("reported_iterations", "iterations that the library behind a method says it took"),
    Column("reported_residuals", "residuals that it says it evaluated"),
    Column("reported_jacobians", "Jacobians that it says it evaluated"),
    Column("reported_factorizations", "set-ups of its preconditioner, here K*, that it says it asked for"),
    Column("reported_triangular_solves", "solves with its preconditioner that it says it asked for"),
)
"""What a library reports of its own work, to compare with what the ledger counts; NaN where it reports nothing."""

RUNS = _by_name(
    Column("case", "identity of the case: a digest of its validated components"),
    Column("status", "how the case ended, in a word or two"),
    Column("message", "how the case ended, in a sentence"),
    Column(
        "interpreter",
        "what a crashed case did to the interpreter: SIGSEGV or another signal, exit code 3, SystemExit, "
        "KeyboardInterrupt; it is run again only with --retry",
    ),
    Column(
        "false_convergence",
        "solves in which the method, or a stopping test other than that of residuals, said converged of a state whose "
        "residual says otherwise",
    ),
    Column("false_failure", "solves in which the method said failed of a state that is a solution"),
    Column("blame_x", "of a failed solve: x of the node where the last residual is largest", "mm"),
    Column("blame_y", "of a failed solve: y of that node", "mm"),
    Column("blame_rate", "of a failed solve: strain rate ε̄ nearest to that node", "1/s"),
    Column("blame_regularized", "of a failed solve: share of the strain points with ε̄ < ε₀ at the last state"),
    Column("blame_unknown", "of a failed solve of a system: the unknown whose equation is farthest from solved"),
    Column("nodes", "N, nodes of the cloud"),
    Column("unknowns", "U, unknown velocity components, or unknowns of a system"),
    Column("cloud_rounds", "adaptive nodes: clouds made from a solution, after the first"),
    Column("estimate_factorizations", "adaptive nodes: matrices factorised to estimate the error of each cloud"),
    Column("smallest_spacing", "smallest distance between two nodes at t = 0", "mm"),
    Column("form", "form of the operators that a flow was solved with: strong or conservative"),
    Column(
        "cloud_quality",
        "moving nodes: least distance of a node to its nearest over that distance at t = 0, over the march",
    ),
    Column(
        "rate_drift", "accumulated strain rates: ‖ε̇ − B v‖/‖ε̇‖ at the end, their distance from those of the velocity"
    ),
    Column("increments", "time steps completed; 1 for a steady state"),
    Column("time", "time reached", "s", "$t$"),
    Column("iterations", "iterations or series used by the method in all increments"),
    Column("pressure_iterations", "iterations of the pressure in all increments, where the scene has a pressure"),
    Column("tangents", "tangents K* factorised during the march (NIM of the 2015 paper)"),
    Column("validity_time", "how long the first tangent of the march served", "s", "time served by the first tangent"),
    Column("factorizations", "matrices factorised during the march", symbol="factorisations"),
    Column("triangular_solves", "pairs of triangular solves during the march"),
    Column("jacobians", "Jacobians assembled during the march"),
    Column("residuals", "residuals evaluated by the method during the march"),
    Column("series_orders", "Taylor coefficients of the residual computed during the march"),
    Column("series_terms", "sum of their orders j: order j convolves j earlier terms, so this is how their cost grows"),
    Column("expansions", "those of the residuals that began a series"),
    Column("matrix_products", "products with an assembled Jacobian during the march"),
    *REPORTED.values(),
    Column("start_factorizations", "matrices factorised on the way to the first state"),
    Column("start_triangular_solves", "pairs of triangular solves on the way to the first state"),
    Column("start_residuals", "residuals evaluated on the way to the first state"),
    Column(
        "start_way", "name of the way to the first state; the rows that share one were served by one solution of it"
    ),
    Column(
        "seconds",
        "time inside the method: its own work and all it asked for",
        "s",
        "time inside the method",
        timed=True,
    ),
    Column("seconds_factorization", "the part of `seconds` spent on factorising", "s", timed=True),
    Column("seconds_triangular_solve", "the part of `seconds` spent on triangular solves", "s", timed=True),
    Column("seconds_jacobian", "the part of `seconds` spent on assembling Jacobians", "s", timed=True),
    Column("seconds_residual", "the part of `seconds` spent on residuals", "s", timed=True),
    Column("seconds_series", "the part of `seconds` spent on series coefficients", "s", timed=True),
    Column(
        "seconds_own", "the part of `seconds` spent by the method itself: norms, mixing, extrapolation", "s", timed=True
    ),
    Column("seconds_most", "`seconds` of the slowest of several rounds", "s", timed=True),
    Column(
        "seconds_predicted",
        "`seconds` by the cost model: counts times unit costs, and own work as with other linear solvers",
        "s",
    ),
    Column("seconds_low", "exclusive lane: lower end of the 95 % interval of the median `seconds`", "s", timed=True),
    Column("seconds_high", "exclusive lane: upper end of the 95 % interval of the median `seconds`", "s", timed=True),
    Column(
        "rounds",
        "how often the case was timed; all seconds are those of its fastest round, in the exclusive lane of the round "
        "whose `seconds` are the median",
    ),
    Column(
        "lane",
        "where the seconds come from: exclusive (one case at a time, warm, pinned to a core, in rounds), alone (one "
        "case at a time) or shared (several at a time, or on a cluster)",
    ),
    Column("core", "exclusive lane: number of the core that the case was pinned to"),
    Column("load", "exclusive lane: share of the time for which others kept the case from its core, median of rounds"),
    Column("clock", "clock of the seconds: wall, or processor, which does not count the time given to other programs"),
    Column("environment", "where the case was computed: a name in the folder `environments` and in the report"),
    Column("unit.residual", "measured on the last problem of the case: seconds of one residual", "s", timed=True),
    Column("unit.expansion", "as unit.residual: beginning a series", "s", timed=True),
    Column("unit.jacobian", "as unit.residual: one Jacobian", "s", timed=True),
    Column("unit.matrix_product", "as unit.residual: one product with a Jacobian", "s", timed=True),
    Column("unit.factorization", "as unit.residual: one factorisation, its ordering known", "s", timed=True),
    Column("unit.triangular_solve", "as unit.residual: one pair of triangular solves", "s", timed=True),
    Column(
        "unit.series_order",
        "as unit.residual: c_order of a Taylor coefficient j, which costs c_order + j c_term",
        "s",
        timed=True,
    ),
    Column(
        "unit.series_term",
        "as unit.residual: c_term of a Taylor coefficient j, which costs c_order + j c_term",
        "s",
        timed=True,
    ),
    Column("seconds_operators", "building operators, the same for every method and not in `seconds`", "s", timed=True),
    Column("seconds_start", "reaching the first state", "s", timed=True),
    Column("seconds_estimate", "adaptive nodes: estimating the error of each cloud", "s", timed=True),
    Column(
        "seconds_all",
        "operators, first state, march and the estimates of adaptive nodes: what the result costs in all",
        "s",
        timed=True,
    ),
    Column("compiled_by", "what compiled the weights of the operators; empty where numpy computes them"),
    Column("linear_chosen", "linear solver that factorised the last tangent, where `auto` chose it"),
    Column("ordering", "column ordering the linear solver used"),
    Column("fill", "entries stored in the last factors", symbol="entries of the factors"),
    Column(
        "factor_solve_ratio",
        "measured time of one factorisation over one pair of triangular solves",
        symbol="factorisation / triangular solve",
        timed=True,
    ),
    Column("condition", "estimate of ‖K*‖₁ ‖K*⁻¹‖₁ for the last tangent, where the linear solver can tell", figures=2),
    Column(
        "residual_norm",
        "largest relative residual accepted in any increment, evaluated outside the method; of a system |F_i| over the "
        "size of what cancels in equation i, largest over the equations",
        symbol="relative residual",
        figures=2,
    ),
    Column(
        "newton_correction",
        "of a problem without a scale of its own: max_j |Δu_j| over the size of u_j, Δu the Newton correction at the "
        "end, evaluated outside the method; NaN where the residual alone told that it is not solved",
        symbol="Newton correction",
        figures=2,
    ),
    Column(
        "residual_absolute",
        "largest ‖R‖₂ accepted in any increment, in the unit of the problem: N/mm³ for a flow, N/mm in a conservative "
        "form of it",
        symbol=r"$\|R\|_2$",
        figures=2,
    ),
    Column(
        "divergence",
        "‖div V‖/‖ε̄‖ over volume points and strain points at the end, with a volumetric term",
        figures=2,
    ),
    Column(
        "velocity_error",
        "relative ℓ² error of the velocities of all nodes at the end, where there is an exact solution",
        symbol="relative error of the velocity",
        relative_error=True,
    ),
    Column(
        "velocity_error_inside",
        "relative ℓ² error of the velocities of the interior nodes alone, which are not given",
        relative_error=True,
    ),
    Column(
        "velocity_error_estimate",
        "estimate of velocity_error_inside, with or without an exact solution: how far the velocities are from those "
        "of a solution on an enriched cloud, with a lower dilatation",
        relative_error=True,
    ),
    Column(
        "worst_error_estimate",
        "the same for the worst node inside: its error over the largest speed",
        relative_error=True,
    ),
    Column(
        "reference_error",
        "relative ℓ² difference of the velocities of all nodes at the end from those of the study's reference case",
        relative_error=True,
    ),
    Column(
        "root_error",
        "max_j |u_j − root_j|/|root_j| for the known root nearest to where a system ended; where root_j = 0, over the "
        "size that the unknown began with",
        relative_error=True,
    ),
    Column(
        "root_singular", "whether the Jacobian of a system is singular at a known root: a small residual says little"
    ),
    Column("torque", "torque of the moving wall on the material per mm of thickness", "N mm/mm"),
    Column(
        "torque_error",
        "relative error of the torque against the exact solution",
        symbol="relative error of the torque",
        relative_error=True,
    ),
    Column("force_x", "x force of the moving wall on the material per mm of thickness", "N/mm"),
    Column("force_y", "y force of the moving wall on the material per mm of thickness", "N/mm"),
    Column(
        "force_error", "‖force − exact force‖/‖exact force‖, where the exact solution has a force", relative_error=True
    ),
    Column(
        "audit.inertia", "‖ρ ∂V/∂t‖/‖∇S‖ over the last increment (on moving nodes ρ dV/dt), where inertia is left out"
    ),
    Column("audit.convection", "‖ρ (V·∇) V‖/‖∇S‖ at the end, where convection is left out and nodes are fixed"),
    Column("audit.compressibility", "‖div V‖/‖ε̄‖ at the end; without a volumetric term from gradients at the nodes"),
    Column("audit.regularization", "share of the strain points with ε̄ < 10 ε₀, for a law with a regularization"),
    Column("audit.regularization_stress", "share of Σ |S| that these strain points carry"),
    Column(
        "audit.regularization_strain",
        "share of Σ ε̄ that these strain points carry; the error inside from ε₀ is about three times this",
    ),
    Column("audit.residual", "‖R‖ over the size of the stresses' forces that cancel in it"),
    Column(
        "audit.balance",
        "‖div S + f − ρ dV/dt‖/‖∇S‖ by operators other than those solved with, where no pressure acts",
    ),
    Column(
        "audit.moment",
        "largest moment of the stresses on discs that is out of balance, over what |S| would have there",
    ),
    Column(
        "audit.resolution",
        "share of the change of V between neighbouring inner nodes that its gradients do not explain",
    ),
    Column(
        "audit.hole",
        "radius of the largest circle in the flow without a node, over the spacing of the nodes around it",
    ),
    Column(
        "audit.heating", "largest adiabatic heating S:ε̇/(ρ c_p) over the time reached, or a time 2π/reference rate", "K"
    ),
    Column(
        "audit.gained_power",
        "largest −S:ε̇ over the largest |S:ε̇| at the strain points; 0 for a viscosity that is positive",
    ),
    Column(
        "audit.falling_stress",
        "part by which 2 μ ε̄ falls below its largest value at a smaller rate, over the range of rates of the state",
    ),
    Column(
        "audit.exact",
        "velocity_error_inside over velocity_error_estimate, where the error is above 5 % and nothing else in doubt: "
        "large where the exact solution does not solve the scene",
    ),
    Column(
        "audit.units",
        "2 μ ε̄ at the reference rate, and in a scene below 0.1 mm the density, over the largest of any material in MPa "
        "and t/mm³: above 1 the numbers look like SI units",
    ),
    Column(
        "doubt",
        "what the audits, a system's roots, steps without counted work, or work in other processes put in doubt, and "
        "the way out; empty when nothing",
    ),
)
"""`runs`: a row a case, whatever its ending. Behind these stand all parameters of the case, dotted ("solver.order")."""

DIAGNOSTICS = _by_name(
    Column("operator", "what the weights are for: strain, force, volume"),
    Column("targets", "places the weights belong to"),
    Column("smallest_support", "fewest neighbours of a place"),
    Column("largest_support", "most neighbours of a place"),
    Column("grown", "places whose support had to grow to become unisolvent and balanced"),
    Column("balance", "smallest ratio of the least to the largest singular value of a support's local system"),
    Column("reproduction_error", "largest error of derivatives of polynomials of the degree, scaled by the weights"),
    Column(
        "largest_weight",
        "largest sum of |weights| times the distance of neighbours: amplification of rounding and noise",
    ),
)
"""`nlsolve diagnose`: a row an operator of a cloud."""

STEPS = _by_name(
    Column("case", "identity of the case"),
    Column("increment", "number of the time step; 0 for a steady state"),
    Column("time", "time at the end of the increment", "s", "$t$"),
    Column("step", "number of the step within the increment; 0 is the state the increment began with"),
    Column("accepted", "whether it is the last step of a finished increment"),
    Column("tangents", "tangents factorised so far in the march"),
    Column("triangular_solves", "pairs of triangular solves so far in the march"),
    Column("residual_norm", "relative residual at the step", symbol="relative residual"),
    Column(
        "residual_absolute",
        "‖R‖₂ at the step, in the unit of the problem: N/mm³ for a flow, N/mm in a conservative form of it",
        symbol=r"$\|R\|_2$",
    ),
    Column(
        "difference",
        "relative difference from the step before, in the norm of the stopping test",
        symbol="relative difference",
    ),
    Column("range", "a_max of the last series computed for the step", symbol=r"$a_{\max}$"),
    Column(
        "range_quantity",
        "by what the range rule decided, at the end of the path: it is within the range where this is at most "
        "range_threshold (for a rule of η: what must not exceed η)",
    ),
    Column("range_threshold", "what range_quantity must not exceed for the range to reach the end of the path"),
    Column(
        "singularity",
        "distance of the nearest singularity of the last series, as a part of its path, from its last terms",
    ),
    Column(
        "limited_by",
        "what limited that range: end of path, the range rule, pole (of a Padé), order (the highest) or cost (a new "
        "branch is cheaper than more orders)",
    ),
    Column(
        "length",
        "step length of the line search, or the part of the path a series advanced",
        symbol="step length",
    ),
    Column(
        "contraction",
        "residual norm over that of the step before, as the refresh rule is told (newton-krylov: per inner iteration; "
        "anm: per order; petsc-snes, kinsol: per solve with K*; scipy-root: per value of R)",
    ),
    *REPORTED.values(),
    Column(
        "seconds",
        "time inside the method so far in the march; in the exclusive lane of the last round",
        "s",
        "time inside the method",
        timed=True,
    ),
    Column("rate_drift", "accumulated strain rates, on accepted steps: ‖ε̇ − B v‖/‖ε̇‖"),
    Column("probe_x", "x of the probe node, on accepted steps", "mm", "$x$"),
    Column("probe_y", "y of the probe node, on accepted steps", "mm", "$y$"),
    Column("probe_u", "x velocity of the probe node, on accepted steps", "mm/s", "$u$"),
    Column("probe_v", "y velocity of the probe node, on accepted steps", "mm/s", "$v$"),
)
"""`steps`: a row an iteration or series, in order. A column that does not apply to a method or scene holds NaN. Behind
these stand the notes of a method for which there is no column, as "note.<name>".
"""

NOTE, MEASURED = "note.", "measured."
"""Before the names of what no column knows: notes of a step by its method, measures of a state by its scene."""


def step_columns(notes: Mapping[str, Any]) -> dict[str, Any]:
    """What a method notes of a step, by columns of `steps`: those described there, or "note.<name>"."""
    return {name if name in STEPS else f"{NOTE}{name}": value for name, value in notes.items()}


def is_timed(column: str) -> bool:
    """Whether a column of `runs` was read from a clock."""
    return column in RUNS and RUNS[column].timed


def is_measured(column: str) -> bool:
    """Whether a column of `runs` holds what was found: described there, or measured by a scene; else a parameter."""
    return column in RUNS or column.startswith(MEASURED)


def run_columns(measures: Mapping[str, Any]) -> dict[str, Any]:
    """What a scene measures of its states, by columns of `runs`: those described there, or "measured.<name>"."""
    return {name if name in RUNS else f"{MEASURED}{name}": value for name, value in measures.items()}


FIELDS = _by_name(
    Column("case", "identity of the case"),
    Column("time", "time of the snapshot", "s", "$t$"),
    Column("node", "number of the node"),
    Column("boundary", "name of the boundary group of the node; empty inside"),
    Column("x0", "x of the node, and of its marker, at t = 0", "mm"),
    Column("y0", "y of the node, and of its marker, at t = 0", "mm"),
    Column("x", "x of the node", "mm", "$x$"),
    Column("y", "y of the node", "mm", "$y$"),
    Column("marker_x", "x of the marker that started at the node; NaN without markers, or once it has left", "mm"),
    Column("marker_y", "y of the marker that started at the node; NaN without markers, or once it has left", "mm"),
    Column("u", "x velocity", "mm/s", "$u$"),
    Column("v", "y velocity", "mm/s", "$v$"),
    Column("exx", "strain rate ε̇xx", "1/s", r"$\dot{\varepsilon}_{xx}$"),
    Column("eyy", "strain rate ε̇yy", "1/s", r"$\dot{\varepsilon}_{yy}$"),
    Column("exy", "strain rate ε̇xy", "1/s", r"$\dot{\varepsilon}_{xy}$"),
    Column("rate", "equivalent strain rate ε̄", "1/s", r"$\bar{\varepsilon}$"),
    Column("viscosity", "viscosity μ(ε̄²) of the law at that rate", "MPa s", r"$\mu$"),
    Column("sxx", "viscous stress Sxx = 2 μ ε̇xx; the whole stress is σ = S − p I", "MPa", "$S_{xx}$"),
    Column("syy", "viscous stress Syy = 2 μ ε̇yy", "MPa", "$S_{yy}$"),
    Column("sxy", "viscous stress Sxy = 2 μ ε̇xy", "MPa", "$S_{xy}$"),
    Column(
        "pressure",
        "pressure, that of the penalty −λ tr ε̇ with it; NaN where the scene is without a penalty",
        "MPa",
        "$p$",
    ),
    Column("exact_u", "exact x velocity; NaN where the scene has none", "mm/s"),
    Column("exact_v", "exact y velocity; NaN where the scene has none", "mm/s"),
    Column("unknown", "system: number of the unknown, from 0"),
    Column("value", "system: the unknown in the state that the solve ended at", "", "$u_j$"),
)
"""`fields`: of a flow a row a node and recorded time, of a system a row an unknown."""

FRAMES: Mapping[str, Mapping[str, Column]] = MappingProxyType({"runs": RUNS, "steps": STEPS, "fields": FIELDS})
"""The columns of each result frame, by its name."""

RENAMED: Mapping[str, str] = MappingProxyType(
    {
        "branches": "tangents",
        "branch": "tangents",
        "said_converged_but_is_not": "false_convergence",
        "said_failed_but_is": "false_failure",
    }
)
"""What columns of `runs` and `steps` were once called -> what they are called now."""


def no_such_column(name: str, known: Iterable[str]) -> str:
    """The sentence for a name that is no column: what the column is called now, or the nearest of the names `known`."""
    known = list(known)
    present = RENAMED.get(name) or moved_name(name)
    if present is not None:
        return f"this column is called {present} now"
    if f"{name}.kind" in known:  # a parameter that is a component, perhaps one that was a word in older studies
        return f"this is a component, whose name is in the column {name}.kind"
    return f"no such column of the results; {did_you_mean(name, known)}"
