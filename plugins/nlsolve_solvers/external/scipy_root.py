"""R(u) = 0, or F(y) = R(u + K*⁻¹ y) = 0 : `scipy.optimize.root`, called directly or preconditioned on the right."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, ClassVar, Literal

import numpy as np
import scipy
from pydantic import Field

from nlsolve.plugin import KeptTangent, NonlinearProblem, NonlinearSolver, SolveError, Status, Step, norm

LEAST_GAIN = 0.1  # each run goes on until this part of the residual it began with is left
MATRIX_IS_ONE = -1.0  # `alpha`: SciPy's methods begin with the Jacobian −1/α, and that of F is near 1


class ScipyRoot(NonlinearSolver):
    """Without `precondition` SciPy is called as anyone calls it: `root(R, start, method=…)`, once. Its iterates, counts
    and claims are those of a direct call with the same options. Where it ends is one step; if the stopping test is not
    met there the method has stagnated, and SciPy's own message says why.

    With `precondition` the unknown is y, which begins at 0; the residual is the true one, and each value of F costs one
    solve and one residual. One run of `root` is one step: until ‖F‖₂ ≤ `tolerance` · scale and a tenth of its first
    value (hybr: until y changes by less than `tolerance`), or until `iterations` are used up. Then the refresh rule is
    told the contraction per value of F and is asked, and the next run begins here.

    hybr needs a dense Jacobian, which it makes of U differences of F, or is given: U products with J, and as many
    solves.
    """

    kind: Literal["scipy-root"] = "scipy-root"
    method: Literal["hybr", "krylov", "broyden1", "anderson", "df-sane"] = Field("krylov", description="as in SciPy")
    tolerance: float = Field(1e-8, gt=0, description="relative residual at which one run ends; xtol of hybr")
    iterations: int = Field(50, gt=0, description="of SciPy's method in one run; not of hybr")
    precondition: bool = Field(True, description="right preconditioning by K*")
    jacobian: Literal["differences", "products"] = Field("differences", description="how hybr comes by its matrix")
    default_refresh: ClassVar = {"kind": "poor-contraction"}
    uses_operator: ClassVar[bool] = True

    def steps(self, problem: NonlinearProblem, tangent: KeptTangent, start: np.ndarray) -> Iterator[Step]:
        """The start, and the ends of the runs. Raises SolveError (stagnated) if a step or pivot of SciPy vanishes, or,
        without preconditioning, where SciPy has ended; (non-finite) if a number of SciPy overflows.
        """
        state, known = start, [problem.residual(start)]
        size = norm(known[0])
        goal = self.tolerance * (problem.scale(start) if self.precondition or problem.has_scale else 1.0)
        if not (self.precondition or problem.operator_is_jacobian):
            raise SolveError(
                Status.NOT_APPLICABLE,
                "without preconditioning there is no K*: set precondition = true, or leave `operator` at its default",
            )
        yield Step(state)
        if not self.precondition:
            found, values = self._run(problem, None, state, known, goal)
            contraction = (norm(found.fun) / size) ** (1.0 / values) if size else 0.0
            yield Step(found.x, bool(found.success), {"contraction": contraction, **reported(found)})
            word = "reports success; lower its `tolerance`, or ask for less" if found.success else "ends here"
            said = " ".join(found.message.split()).rstrip(".")
            raise SolveError(Status.STAGNATED, f"scipy.optimize.root, {self.method}, {word}: {said}")
        while True:
            tangent.refresh_if_due(lambda: problem.operator(state))
            found, values = self._run(problem, tangent, state, known, min(goal, LEAST_GAIN * size))
            state = state + tangent.solve(found.x)
            to_the_end = self.method == "hybr" or goal <= LEAST_GAIN * size
            before, size = size, norm(found.fun)
            contraction = (size / before) ** (1.0 / values) if before else 0.0
            tangent.observe(contraction=contraction)
            claim = True if found.success and to_the_end else None
            yield Step(state, claim, {"contraction": contraction, **reported(found)})

    def _run(
        self,
        problem: NonlinearProblem,
        tangent: KeptTangent | None,
        state: np.ndarray,
        known: list[np.ndarray],
        goal: float,
    ) -> tuple[Any, int]:
        """What one run of SciPy's method found, from y = 0 or without a K* from u = `state`, and how many values of F
        it took. SciPy asks for the one at its start first: a value that is `known` is handed over and forgotten.
        """
        values = 0

        def moved(y: np.ndarray) -> np.ndarray:
            if tangent is None:
                return y
            return state + (tangent.solve(y) if y.any() else y)

        def shifted(y: np.ndarray) -> np.ndarray:
            nonlocal values
            values += 1
            if known:
                return known.pop()
            return problem.residual(moved(y))

        def columns(y: np.ndarray) -> np.ndarray:
            jacobian = problem.jacobian(moved(y))
            directions = (e if tangent is None else tangent.solve(e) for e in np.eye(len(y)))
            return np.stack([jacobian @ direction for direction in directions], axis=1)

        given = columns if self.method == "hybr" and self.jacobian == "products" else None
        try:
            begin = state if tangent is None else np.zeros_like(state)
            found = scipy.optimize.root(shifted, begin, jac=given, method=self.method, options=self._options(goal))
        except ValueError as error:  # how SciPy's Jacobians say that a step or a pivot vanished
            raise SolveError(Status.STAGNATED, f"scipy.optimize.root, {self.method}: {error}") from error
        except (OverflowError, ZeroDivisionError) as error:  # its line searches work with numbers of Python
            said = f"a number overflows or is divided by zero in its line search ({error}); choose another method"
            raise SolveError(Status.NON_FINITE, f"scipy.optimize.root, {self.method}: {said}") from error
        return found, values

    def _options(self, goal: float) -> dict[str, Any]:
        if self.method == "hybr":
            return {"xtol": self.tolerance, "maxfev": 0}
        if self.method == "df-sane":
            return {"fatol": goal, "ftol": 0.0, "fnorm": np.linalg.norm, "maxfev": self.iterations}
        options = {"fatol": goal, "tol_norm": np.linalg.norm, "maxiter": self.iterations}
        begins_at_one = self.precondition and self.method != "krylov"
        return options | ({"jac_options": {"alpha": MATRIX_IS_ONE}} if begins_at_one else {})


def reported(found: Any) -> dict[str, float]:
    """SciPy's counters, by the names of our columns; no method of SciPy has all of them."""
    counters = {"reported_iterations": "nit", "reported_residuals": "nfev", "reported_jacobians": "njev"}
    return {name: found[counter] for name, counter in counters.items() if counter in found}
