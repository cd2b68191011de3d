"""Newton-Krylov: GMRES for a Newton equation, and the forcing terms, how well the equation is worth solving."""

from nlsolve_solvers.krylov.newton_krylov import NewtonKrylov

__all__ = ["NewtonKrylov"]
