"""f(x, y) from text, such as "sin(pi*x)*cosh(y)", and its derivatives by the arithmetic of series.

The text is parsed, never executed. It may hold numbers, x, y, pi, e, + − * / ** and the functions below only.
"""

from __future__ import annotations

import ast
import math
import operator
from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache
from typing import Annotated, Any

import numpy as np
from pydantic import AfterValidator, Field

from nlsolve.plugin import Series

FUNCTIONS = {f.__name__: f for f in (np.sin, np.cos, np.tanh, np.sinh, np.cosh, np.exp, np.log, np.sqrt)}
CONSTANTS = {"pi": np.float64(math.pi), "e": np.float64(math.e)}
BINARY: dict[type[ast.operator], Callable[[Any, Any], Any]] = {
    ast.Add: operator.add,
    ast.Sub: operator.sub,
    ast.Mult: operator.mul,
    ast.Div: operator.truediv,
    ast.Pow: operator.pow,
}
UNARY: dict[type[ast.unaryop], Callable[[Any], Any]] = {ast.USub: operator.neg, ast.UAdd: operator.pos}
ALLOWED = f"numbers, x, y, {', '.join(CONSTANTS)}, + - * / **, and {', '.join(FUNCTIONS)} of one argument"

Function = Callable[[Any, Any], Any]


@lru_cache(maxsize=256)
def formula(text: str) -> Function:
    """f(x, y), for arrays or series, in the shape of x and y. Raises ValueError naming what `text` must not hold."""
    try:
        tree = ast.parse(text.strip(), mode="eval")
    except SyntaxError as error:
        raise ValueError(f"{text!r} is not a formula ({error.msg}); it may hold {ALLOWED}") from None
    f = _compiled(tree.body)
    return lambda x, y: f(x, y) + 0.0 * x  # a constant formula takes the shape of x too


def _compiled(node: ast.expr) -> Function:
    match node:
        case ast.Constant(value=int() | float() as value) if not isinstance(value, bool):
            number = np.float64(value)
            return lambda x, y: number
        case ast.Name(id="x"):
            return lambda x, y: x
        case ast.Name(id="y"):
            return lambda x, y: y
        case ast.Name(id=name) if name in CONSTANTS:
            return lambda x, y: CONSTANTS[name]
        case ast.UnaryOp(op=op, operand=operand) if type(op) in UNARY:
            sign, inner = UNARY[type(op)], _compiled(operand)
            return lambda x, y: sign(inner(x, y))
        case ast.BinOp(left=left, op=op, right=right) if type(op) in BINARY:
            if isinstance(op, ast.Pow) and any(isinstance(n, ast.Name) and n.id in ("x", "y") for n in ast.walk(right)):
                raise ValueError(f"{ast.unparse(node)!r}: an exponent must be a number; write exp(b*log(a)) for a**b")
            join, first, second = BINARY[type(op)], _compiled(left), _compiled(right)
            return lambda x, y: join(first(x, y), second(x, y))
        case ast.Call(func=ast.Name(id=name), args=[argument], keywords=[]) if name in FUNCTIONS:
            function, inner = FUNCTIONS[name], _compiled(argument)
            return lambda x, y: function(inner(x, y))
    raise ValueError(f"{ast.unparse(node)!r} is not allowed in a formula; it may hold {ALLOWED}")


def _accepted(text: str) -> str:
    formula(text)
    return text


Formula = Annotated[str, Field(max_length=500), AfterValidator(_accepted)]
"""A field of a component that holds the text of a formula in x and y."""


@dataclass(frozen=True)
class Jet:
    """f and its first and second derivatives at N points, (N,) each."""

    f: np.ndarray
    x: np.ndarray
    y: np.ndarray
    xx: np.ndarray
    xy: np.ndarray
    yy: np.ndarray

    @classmethod
    def of(cls, text: str, points: np.ndarray) -> Jet:
        """f(x + a d) = f + a f_d + ½ a² f_dd + … along e_x, e_y, and e_x + e_y with f_dd = f_xx + 2 f_xy + f_yy."""

        def along(*direction: float) -> list[np.ndarray]:
            path = [Series(coordinate) for coordinate in points.T]
            for coordinate, slope in zip(path, direction, strict=True):
                coordinate.append(np.full(len(points), slope))
                coordinate.append(np.zeros(len(points)))
            values = formula(text)(*path)
            return [values.coefficient(j) for j in range(3)]

        (f, x, xx), (_, y, yy), (_, _, both) = along(1.0, 0.0), along(0.0, 1.0), along(1.0, 1.0)
        return cls(f, x, y, 2.0 * xx, both - xx - yy, 2.0 * yy)
