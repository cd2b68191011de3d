"""Compare nonlinear solution strategies on equal terms."""

from importlib.metadata import PackageNotFoundError, version

from nlsolve.assembled import AssembledOnce
from nlsolve.component import Component
from nlsolve.discretizers import Discretizer, Operators
from nlsolve.globalization import Globalization, Search
from nlsolve.hookspecs import hookimpl
from nlsolve.laws import ConstitutiveLaw, PowerForm, local_index, stress
from nlsolve.linear import Factors, LinearSolver
from nlsolve.nested import Globalized
from nlsolve.predictors import Predictor
from nlsolve.problems import Expansion, NonlinearProblem
from nlsolve.runner import Results, run
from nlsolve.scenes import Cloud, Exact, Scene
from nlsolve.series import Series, upright
from nlsolve.solvers import Evidence, KeptTangent, NonlinearSolver, RefreshRule, Step
from nlsolve.status import SolveError, Status
from nlsolve.studies import Study
from nlsolve.systems import System

try:
    __version__ = version("nlsolve")
except PackageNotFoundError:  # a checkout on the path, not installed: no plugins either
    __version__ = "not installed"

__all__ = [
    "AssembledOnce",
    "Cloud",
    "Component",
    "ConstitutiveLaw",
    "Discretizer",
    "Evidence",
    "Exact",
    "Expansion",
    "Factors",
    "Globalization",
    "Globalized",
    "KeptTangent",
    "LinearSolver",
    "NonlinearProblem",
    "NonlinearSolver",
    "Operators",
    "PowerForm",
    "Predictor",
    "RefreshRule",
    "Results",
    "Scene",
    "Search",
    "Series",
    "SolveError",
    "Status",
    "Step",
    "Study",
    "System",
    "__version__",
    "hookimpl",
    "local_index",
    "run",
    "stress",
    "upright",
]
