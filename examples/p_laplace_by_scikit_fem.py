"""A partial differential equation of your own: −∇·(μ ∇u) = 1 in the unit disc, by linear elements of scikit-fem.

μ = (|∇u|² + ε²)^((p−2)/2), u = 0 on the boundary; for ε = 0 the solution is (1 − 1/p) 2^(−1/(p−1)) (1 − r^(p/(p−1))).
The residual is one formula that runs on arrays and on series, so the homotopy takes part; the Jacobian is assembled by
scikit-fem.

    python examples/p_laplace_by_scikit_fem.py
"""

from __future__ import annotations

from typing import Any, Literal

import numpy as np
from pydantic import Field
from skfem import Basis, BilinearForm, ElementTriP0, ElementTriP1, LinearForm, MeshTri
from skfem.helpers import dot, grad

import nlsolve
from nlsolve.plugin import Expansion, NonlinearProblem, Scene, Series, SingleSolve


class Disc(NonlinearProblem):
    """R(u) = Dᵀ μ(|D u/a|²) D u/a − f for the inner nodal values u (U,); D u are integrals of ∇u over triangles of
    areas a.
    """

    is_gradient = True

    def __init__(self, scene: PLaplace) -> None:
        self.power, self.floor = scene.power, scene.regularization**2
        mesh = MeshTri.init_circle(scene.refinements)
        self.basis, means = Basis(mesh, ElementTriP1()), Basis(mesh, ElementTriP0())
        self.inside = self.basis.complement_dofs(self.basis.get_dofs())
        self.areas = LinearForm(lambda v, w: v).assemble(means)
        slopes = [BilinearForm(lambda u, v, w, i=i: grad(u)[i] * v).assemble(self.basis, means) for i in (0, 1)]
        self.slopes = [slope.tocsc()[:, self.inside].tocsr() for slope in slopes]
        self.load = LinearForm(lambda v, w: v).assemble(self.basis)[self.inside]

    def viscosity(self, slope_squared: Any) -> Any:
        return (slope_squared + self.floor) ** (0.5 * self.power - 1.0)

    def residual(self, u: Any) -> Any:
        x, y = (slope @ u * (1.0 / self.areas) for slope in self.slopes)
        mu = self.viscosity(x * x + y * y)
        return self.slopes[0].T @ (mu * x) + self.slopes[1].T @ (mu * y) - self.load

    def jacobian(self, u: np.ndarray) -> Any:
        def form(du: Any, v: Any, w: Any) -> Any:
            squared = dot(w["u"].grad, w["u"].grad)
            stiffening = (self.power - 2.0) * (squared + self.floor) ** (0.5 * self.power - 2.0)
            along = dot(w["u"].grad, grad(du)) * dot(w["u"].grad, grad(v))
            return self.viscosity(squared) * dot(grad(du), grad(v)) + stiffening * along

        values = self.basis.zeros()
        values[self.inside] = u
        matrix = BilinearForm(form).assemble(self.basis, u=self.basis.interpolate(values))
        return matrix.tocsr()[self.inside][:, self.inside]

    def expand(self, u: np.ndarray) -> Expansion:
        path = Series(u)
        return Expansion(path, self.residual(path))

    def exact(self) -> np.ndarray:
        p, radius = self.power, np.hypot(*self.basis.doflocs[:, self.inside])
        return (1.0 - 1.0 / p) * 2.0 ** (-1.0 / (p - 1.0)) * (1.0 - radius ** (p / (p - 1.0)))


class PLaplace(Scene):
    """What a study says of it: `scene = { kind = "p-laplace", power = 1.5 }`."""

    kind: Literal["p-laplace"] = "p-laplace"
    power: float = Field(1.5, gt=1, description="p")
    regularization: float = Field(1e-3, gt=0, description="ε")
    refinements: int = Field(4, ge=1, description="of the disc of four triangles, each into four")

    def simulation(self, parts: Any, entry: Any) -> SingleSolve:
        with entry("operators"):
            problem = Disc(self)
        start = 0.5 * problem.exact()

        def measure(u: np.ndarray) -> dict[str, float]:
            return {"error": float(np.linalg.norm(u - problem.exact()) / np.linalg.norm(problem.exact()))}

        return SingleSolve(problem, start, measure)


STUDY = {
    "question": "Which strategy solves the p-Laplace equation in a disc with the fewest factorisations?",
    "scene": PLaplace(),
    "solver": {"kind": "newton"},
    "sweep": [
        {"grid": {"solver.kind": ["newton", "modified-newton", "newton-krylov", "anderson", "anm"]}},
        {"grid": {"scene.refinements": [3, 4, 5]}},
    ],
    "table": [
        {
            "name": "strategies",
            "rows": ["scene.refinements", "solver.kind"],
            "value": ["tangents", "triangular_solves", "residuals", "residual_norm", "measured.error"],
        }
    ],
}

if __name__ == "__main__":
    print(nlsolve.run(STUDY).table("strategies").to_string())
