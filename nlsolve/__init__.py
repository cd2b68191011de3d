"""Compare nonlinear solution strategies on equal terms: the users' door.

Every name is loaded when it is first asked for, so that `import nlsolve` costs nothing.
"""

from __future__ import annotations

from importlib import import_module
from importlib.metadata import PackageNotFoundError, version
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from nlsolve.contracts.status import SolveError, Status
    from nlsolve.running.runner import Results, run
    from nlsolve.study.study import Study

try:
    __version__ = version("nlsolve")
except PackageNotFoundError:  # a checkout on the path, not installed: no plugins either
    __version__ = "not installed"

_HOME = {
    "Results": "nlsolve.running.runner",
    "SolveError": "nlsolve.contracts.status",
    "Status": "nlsolve.contracts.status",
    "Study": "nlsolve.study.study",
    "run": "nlsolve.running.runner",
}

__all__ = ["Results", "SolveError", "Status", "Study", "__version__", "run"]


def __getattr__(name: str) -> Any:
    if name not in _HOME:
        raise AttributeError(
            f"module 'nlsolve' has no attribute {name!r}: what plugins are written with is in nlsolve.plugin"
        )
    value = getattr(import_module(_HOME[name]), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return __all__
