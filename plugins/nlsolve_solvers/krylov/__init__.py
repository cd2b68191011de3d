"""Newton-Krylov: how well a Newton equation is solved, by GMRES, and how well it is worth solving."""

from nlsolve_solvers.krylov.newton_krylov import NewtonKrylov

__all__ = ["NewtonKrylov"]
