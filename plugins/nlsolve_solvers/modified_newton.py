"""u ← u − t K*⁻¹ R(u) with K* kept : modified Newton."""

from __future__ import annotations

from typing import ClassVar, Literal

from nlsolve_solvers.newton import Newton


class ModifiedNewton(Newton):
    """Newton's iteration with a tangent kept across iterations and increments until it contracts poorly."""

    kind: Literal["modified-newton"] = "modified-newton"  # type: ignore[assignment]
    default_refresh: ClassVar = {"kind": "poor-contraction"}
