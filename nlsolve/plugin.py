"""The plugin authors' door: all contracts and helpers. A plugin imports nothing else of nlsolve."""

from __future__ import annotations

from nlsolve.algebra.system import System
from nlsolve.contracts.component import Component, InputFile
from nlsolve.contracts.continuum.adaptive import AdaptiveNodes, Spacing
from nlsolve.contracts.continuum.cloud import Cloud, Exact, hat_gradients
from nlsolve.contracts.continuum.discretizer import Discretizer, Operators, PointOperators
from nlsolve.contracts.continuum.law import ConstitutiveLaw, PowerForm, local_index, stress, tangent_moduli
from nlsolve.contracts.continuum.near import largest_near
from nlsolve.contracts.continuum.terms import NodeMotion, Physics, Recording, TimeSteps
from nlsolve.contracts.continuum.triangulation import doubled_areas, in_order, on_one_wall, side_keys, subdivided
from nlsolve.contracts.continuum.walls import middles as wall_middles
from nlsolve.contracts.continuum.walls import wall_edges
from nlsolve.contracts.linear_solver import Factors, LinearSolver
from nlsolve.contracts.nonlinear_solver import KeptTangent, NonlinearSolver, Step
from nlsolve.contracts.problem import Expansion, NonlinearProblem, least_squares, norm, unit
from nlsolve.contracts.rules.globalization import Globalization, Search
from nlsolve.contracts.rules.homotopy_form import HomotopyForm, Recurrence
from nlsolve.contracts.rules.operator import Assembly, IterationOperator
from nlsolve.contracts.rules.predictor import Predictor
from nlsolve.contracts.rules.range_rule import Range, RangeRule, SeriesBranch
from nlsolve.contracts.rules.refresh import RefreshRule, TangentHistory
from nlsolve.contracts.scene import Entry, Misfit, Preparation, Scene, Section, Simulation, SingleSolve, Solve, Workload
from nlsolve.contracts.status import SolveError, Status
from nlsolve.flow.scene import FlowScene
from nlsolve.registry.installed.hookspecs import hookimpl
from nlsolve.registry.nested import AnyDiscretizer, AnyForm, AnyRange, Globalized
from nlsolve.series import NoSeries, NoSeriesHere, Series, as_column
from nlsolve.solving.anderson_mixing import Mixing
from nlsolve.solving.matrices import cached_jacobian

__all__ = [
    "AdaptiveNodes",
    "AnyDiscretizer",
    "AnyForm",
    "AnyRange",
    "Assembly",
    "Cloud",
    "Component",
    "ConstitutiveLaw",
    "Discretizer",
    "Entry",
    "Exact",
    "Expansion",
    "Factors",
    "FlowScene",
    "Globalization",
    "Globalized",
    "HomotopyForm",
    "InputFile",
    "IterationOperator",
    "KeptTangent",
    "LinearSolver",
    "Misfit",
    "Mixing",
    "NoSeries",
    "NoSeriesHere",
    "NodeMotion",
    "NonlinearProblem",
    "NonlinearSolver",
    "Operators",
    "Physics",
    "PointOperators",
    "PowerForm",
    "Predictor",
    "Preparation",
    "Range",
    "RangeRule",
    "Recording",
    "Recurrence",
    "RefreshRule",
    "Scene",
    "Search",
    "Section",
    "Series",
    "SeriesBranch",
    "Simulation",
    "SingleSolve",
    "Solve",
    "SolveError",
    "Spacing",
    "Status",
    "Step",
    "System",
    "TangentHistory",
    "TimeSteps",
    "Workload",
    "as_column",
    "cached_jacobian",
    "doubled_areas",
    "hat_gradients",
    "hookimpl",
    "in_order",
    "largest_near",
    "least_squares",
    "local_index",
    "norm",
    "on_one_wall",
    "side_keys",
    "stress",
    "subdivided",
    "tangent_moduli",
    "unit",
    "wall_edges",
    "wall_middles",
]
