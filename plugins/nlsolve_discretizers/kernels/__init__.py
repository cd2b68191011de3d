"""Formulas for many targets that numba compiles where it is installed: extra nlsolve[numba]. Else numpy runs them."""

from nlsolve_discretizers.kernels import normal_equations, offsets, products, quadrants, ranking, rows
from nlsolve_discretizers.kernels.machine_code import compiler_name

KERNELS = (normal_equations, offsets, products, quadrants, ranking, rows)


def loaded() -> str | None:
    """Compile all, or load what an earlier process has compiled; the compiler's name, None where numpy runs them."""
    for kernel in KERNELS:
        kernel.machine_code()
    return compiler_name()


__all__ = ["KERNELS", "loaded"]
