"""The checks of globalizations, predictors, refresh rules, iteration operators, range rules and homotopy forms."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from nlsolve.contracts.problem import NonlinearProblem
from nlsolve.contracts.rules.globalization import Globalization
from nlsolve.contracts.rules.homotopy_form import HomotopyForm
from nlsolve.contracts.rules.operator import IterationOperator
from nlsolve.contracts.rules.predictor import Predictor
from nlsolve.contracts.rules.range_rule import RangeRule
from nlsolve.contracts.rules.refresh import RefreshRule, TangentHistory
from nlsolve.contracts.status import SolveError
from nlsolve.series import Array
from nlsolve.solving.matrices import CheckedOperator
from nlsolve.solving.tangent import Tangent
from nlsolve.solving.work.ledger import Ledger
from nlsolve.testing.kit.verdicts import promise
from nlsolve.testing.promises import norm, require, same, shaped
from nlsolve.testing.toy_problem import DenseLU, ToyProblem


def check_globalization(globalization: Globalization) -> None:
    """Check the search for step lengths on a toy problem with a potential.

    The length is positive and comes with the residual of the state it leads to; no argument is changed; near the
    solution Newton's full step is taken; one solve remembers nothing of another. Raises AssertionError.
    """
    problem = ToyProblem()
    problem.is_gradient = True  # A is symmetric

    def first(far: float) -> float:
        state = ToyProblem.solution + far * np.cos(np.arange(12.0))
        residual = problem.residual(state)
        direction = -np.linalg.solve(problem.jacobian(state).toarray(), residual)
        given = [state.copy(), residual.copy(), direction.copy()]
        length, found = globalization.search(problem).length(problem, state, residual, direction)
        with promise("length", "the step length is a positive finite number"):
            require(0.0 < length < np.inf, f"a step length of {length}")
        with promise("residual", "the residual that comes with it is that of the state at the end of the step"):
            expected = problem.residual(state + length * direction)
            shaped(found, expected.shape, "the residual at the end of the step")
            same(found, expected, norm(expected), "the residual at the end of the step")
        with promise("no mutation", "neither the state nor the residual nor the direction is changed"):
            unchanged = all(map(np.array_equal, given, (state, residual, direction)))
            require(unchanged, "the search changed the state, the residual or the direction it was given")
        return length

    with promise("full step", "near the solution Newton's full step is taken"):
        require(first(0.01) == 1.0, "a full step of Newton near the solution was not taken")
    for far in (0.5, 5.0):
        with promise("determinism", "one solve remembers nothing of another"):
            again = first(far) == first(far)
            require(again, "the first length of a second solve is another: what is kept is of one solve")


def check_predictor(predictor: Predictor) -> None:
    """Check the guesses from 1, 2, … `depth` known increments.

    The guess of a steady flow is that flow, to 1e-12. A guess has the shape of the velocities, does not change them,
    and is the same each time. Raises AssertionError.
    """
    with promise("depth", "depth is a property, a number ≥ 1"):
        depth: Any = predictor.depth
        require(not callable(depth), "depth is a method: write @property above it, so that it is read")
        require(depth >= 1, f"a depth of {depth}: at least the last increment is looked at")
    steady = np.random.default_rng(0).standard_normal((7, 2))
    for known in range(1, predictor.depth + 1):
        past = [steady.copy() for _ in range(known)]
        with promise("shape", "a guess has the shape of the velocities"):
            guess = predictor.guess(past)
            require(guess.shape == steady.shape, f"a guess of shape {guess.shape} for velocities of {steady.shape}")
        with promise("steady", "the guess of a steady flow is that flow, to 1e-12"):
            same(guess, steady, 1.0, f"the guess of a steady flow from {known} increments", 1e-12)
        with promise("no mutation", "the velocities are not changed"):
            require(all(np.array_equal(v, steady) for v in past), "the predictor changed the velocities it looked at")
        with promise("determinism", "a guess is the same each time"):
            alike = np.array_equal(predictor.guess(past), guess)
            require(alike, "guess changed its mind: it may look at the past only")


def check_refresh_rule(rule: RefreshRule) -> None:
    """Check that `due` answers True or False to any history, also one with None (not observed) or NaN, and the same
    each time. Raises AssertionError.
    """
    for seen in (None, 0.0, 0.5, 1.0, 1e9, np.nan):
        for history in (TangentHistory(1, seen), TangentHistory(1, None, seen), TangentHistory(99, seen, seen)):
            with promise("answer", "due answers True or False to any history, also where nothing or NaN was observed"):
                first, again = rule.due(history), rule.due(history)
                require(isinstance(first, (bool, np.bool_)), f"due({history}) is {first!r}, not True or False")
            with promise("determinism", "the same history gives the same answer"):
                require(first == again, f"due({history}) changed its mind: a rule may look at the history only")


class KnownBranch:
    """The `SeriesBranch` of G(W) = (1 − q) ∘ W − w with K* = 1, of which all is known in closed form:

        W_j = r_j = q^(j−1) ∘ w,    W(a) leaves −a^(p+1) q^p ∘ w in (1 − a) K* W + a G(W)

    q : (U,), by how much an order is smaller than the one before, in each unknown.
    """

    def __init__(self, q: Array, order: int) -> None:
        self._q, self._w, self.order = q, np.cos(np.arange(1.0, len(q) + 1.0)), order
        self.terms = [q**j * self._w for j in range(order)]
        self.sizes = [norm(term) for term in self.terms]
        self.columns = np.asarray(np.linalg.qr(np.stack(self.terms, axis=1), mode="r"))
        self.residual = self.sizes[0]

    @property
    def contraction(self) -> float:
        """(‖r_p‖/‖r_1‖)^(1/(p−1))."""
        return float((self.sizes[-1] / self.sizes[0]) ** (1.0 / (self.order - 1)))

    @property
    def singularity(self) -> float:
        """(‖W_{p−2}‖/‖W_p‖)^(1/2)."""
        return float((self.sizes[-3] / self.sizes[-1]) ** 0.5)

    def approximant(self, order: int | None = None) -> Callable[[float], Array]:
        """The series of the first `order` terms."""
        p = order or self.order
        return lambda a: self.columns[:, :p] @ a ** np.arange(1.0, p + 1.0)

    def next_coefficient(self) -> Array:
        """q^p ∘ w."""
        return self._q**self.order * self._w

    def defect(self, a: float) -> float:
        """a^(p+1) ‖q^p ∘ w‖."""
        return float(a ** (self.order + 1)) * norm(self.next_coefficient())

    def numbers(self) -> list[Array]:
        """Copies of all arrays that a rule can reach."""
        return [np.array(values) for values in (*self.terms, self.columns, self.sizes)]


def check_range_rule(rule: RangeRule) -> None:
    """Check the ranges of branches that are known in closed form: fast and slow, converging and not, of orders 3 to 15.

    a_max is positive or infinite, and the same each time; it grows with η, or is infinite; whether it reaches the end
    of the path does not depend on `used`; the branch is not changed. Raises AssertionError.
    """
    line = np.linspace(-1.0, 1.0, 16) + 0.01
    for q in (0.05 * line, 0.6 * line, 1.5 * line):
        for order in (3, 8, 15):
            branch = KnownBranch(q, order)
            before = branch.numbers()
            case = f"of order {order} with terms that fall by {np.abs(q).max():.2g} each"
            ranges = []
            for tolerance in (1e-12, 1e-6, 1e-2):
                what = f"a branch {case} and η = {tolerance:g}"
                with promise("range", "a_max is positive or infinite"):
                    found, again = rule.limit(branch, tolerance, True), rule.limit(branch, tolerance, True)
                    what = f"a_max = {found.a_max} for {what}"
                    require(found.a_max > 0.0, f"{what}: a range is positive or infinite")
                with promise("determinism", "a_max of a branch is the same each time"):
                    require(found.a_max == again.a_max, f"{what} was {again.a_max} when it was asked again")
                with promise("unused", "whether the end of the path is reached does not depend on `used`"):
                    growing = rule.limit(branch, tolerance, False).a_max
                    alike = (growing >= 1.0) == (found.a_max >= 1.0)
                    require(alike, f"{what}, but {growing} where it will not be used")
                ranges.append(found.a_max)
            with promise("growth", "a_max grows with η, or is infinite"):
                require(ranges == sorted(ranges), f"a_max of a branch {case} falls where η grows: {ranges}")
                grows = ranges[0] < ranges[-1] or np.isinf(ranges[0])
                require(grows, f"a_max of a branch {case} does not grow with η")
            with promise("no mutation", "the branch is not changed"):
                require(all(map(np.array_equal, before, branch.numbers())), f"the rule changed a branch {case}")


def check_homotopy_form(form: HomotopyForm) -> None:
    """Check the recurrence of a form on a toy problem, with K* the tangent at the state and the tangent elsewhere.

    r_1 = −G(0); a right-hand side is the same when it is asked for again; with W_1 … W_p the homotopy is met up to
    O(a^(p+1)); the state is not changed. Raises AssertionError.
    """
    problem, order = ToyProblem(), 4
    state = ToyProblem.solution + 0.5 * np.cos(np.arange(12.0))
    kept = state.copy()
    for shift in (0.0, 0.2):
        matrix = problem.jacobian(state + shift).toarray()
        with promise("first", "r_1 = −G(0)"):
            recurrence = form.recurrence(problem, state)
            first = problem.residual(state)
            same(recurrence.right_hand_side(), -first, norm(first), "r_1, which is −G(0)")
        terms, rhs = list[Array](), list[Array]()
        for _ in range(order):
            with promise("again", "a right-hand side is the same when it is asked for again"):
                rhs.append(recurrence.right_hand_side().copy())
                again = recurrence.right_hand_side()
                require(np.array_equal(again, rhs[-1]), f"r_{len(rhs)} is another when it is asked for again")
            terms.append(np.linalg.solve(matrix, rhs[-1]))
            recurrence.append(terms[-1])

        def missed(a: float) -> float:
            weights = a ** np.arange(1.0, order + 1.0)
            g = problem.residual(state + weights @ np.array(terms))
            return norm(recurrence.miss(a, g, weights, rhs))

        with promise("order", "with W_1 … W_p the homotopy is met up to O(a^(p+1))"):
            found = float(np.log2(missed(0.1) / missed(0.05)))
            require(
                abs(found - order - 1) <= 0.3,
                f"W_1 … W_{order} leave O(a^{found:.2f}) in the homotopy, not O(a^{order + 1})",
            )
    with promise("no mutation", "the state is not changed"):
        require(np.array_equal(state, kept), "the form changed the state it was given")


def check_operator(
    operator: IterationOperator, problem: NonlinearProblem | None = None, start: Array | None = None
) -> None:
    """Check the K* of an operator on a toy problem, or on the problem given with a state (U,) of it.

    Each K* is a square matrix of the problem's size, finite and invertible, before and after a problem has been solved;
    no state is changed; two marches are alike, so nothing of one is remembered in another. Raises AssertionError.
    """
    posed = ToyProblem() if problem is None else problem
    u = ToyProblem.solution + 0.5 * np.cos(np.arange(12.0)) if start is None else start
    later, given = 1.01 * u, u.copy()

    def march() -> list[Array]:
        """The K* at u, and the one at another state once u has been solved for, or the first when there is no other."""
        made, found = CheckedOperator(operator), list[Array]()
        kept = Tangent(DenseLU(), None, Ledger(), operator=made)

        def assemble(state: Array) -> Array:
            found.append(made.matrix(posed, state).toarray())
            return found[-1]

        for state in (u, later):
            try:
                kept.refresh_if_due(lambda: assemble(state))
                kept.solve(posed.residual(state))
            except SolveError as error:
                raise AssertionError(f"no K* to iterate with: {error}") from error
            made.solved(posed, state)
        return found

    with promise("usable", "each K* is a square matrix of the problem's size, finite and invertible"):
        first = march()
    with promise("determinism", "two marches are alike: what is remembered is of one march"):
        again = march()
        require(len(first) == len(again), "a second march renewed K* at other times than the first")
        for mine, other in zip(first, again, strict=True):
            same(mine, other, float(np.abs(mine).max()), "the K* of a second march")
    with promise("no mutation", "no state is changed"):
        unchanged = np.array_equal(u, given) and np.array_equal(later, 1.01 * given)
        require(unchanged, "the operator changed a state")
    with promise("tangent", "K* of an operator that says is_tangent is J(u)"):
        if operator.is_tangent:
            expected = posed.jacobian(u).toarray()
            same(first[0], expected, float(np.abs(first[0]).max()), "K*, said to be the tangent,")
