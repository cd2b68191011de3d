"""Functions as machine code, where numba is installed (extra nlsolve[numba]).

numba keeps what it has compiled beside the source, or in the user's cache, until the source changes: only the first
process waits for it.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import cache
from importlib import import_module
from importlib.util import find_spec
from typing import Any

_allowed = True


def each(begin: int, end: int) -> Any:
    """The indices from `begin` on, before `end`: one slice for numpy; one after the other as machine code."""
    return (slice(begin, end),)


def compiled(function: Callable[..., Any], arguments: str, *called: Callable[..., Any]) -> Callable[..., Any] | None:
    """`function` as machine code; None where there is no compiler.

    arguments : the kind (f, i, b, and u: whole numbers ≥ 0 of half the size) and the number of indices of each, and c
        for an array whose numbers lie in order, e.g. "f2 i0 u2c"; arrays are only read.
    called : the functions that it calls, of its own file: when that changes all is compiled again.
    """
    return _code(function, arguments, called) if _allowed and compiler() is not None else None


def compiler_name() -> str | None:
    """Name and version of the compiler; None where there is none."""
    return f"numba {compiler().__version__}" if _allowed and compiler() is not None else None


@contextmanager
def numpy_alone() -> Iterator[None]:
    """Nothing is compiled meanwhile, as if there were no compiler: to compare the two."""
    global _allowed
    before, _allowed = _allowed, False
    try:
        yield
    finally:
        _allowed = before


@cache
def compiler() -> Any:
    """The library numba; None where it is not installed, or told not to compile (NUMBA_DISABLE_JIT=1).

    Warns where it is installed but cannot be imported.
    """
    if find_spec("numba") is None:
        return None
    try:
        numba = import_module("numba")  # what builds no operators does without
        overload = import_module("numba.extending").overload(each, inline="always")  # inline: so loops become vectors
        overload(lambda begin, end: lambda begin, end: range(begin, end))
    except ImportError as error:  # it refuses versions of numpy that it does not know yet
        warnings.warn(f"numpy computes the weights, as numba cannot be used: {error}", RuntimeWarning, stacklevel=2)
        return None
    return None if numba.config.DISABLE_JIT else numba


@cache
def _code(function: Callable[..., Any], arguments: str, called: tuple[Callable[..., Any], ...]) -> Callable[..., Any]:
    numba = compiler()
    kinds = {"f": numba.float64, "i": numba.int64, "u": numba.uint32, "b": numba.boolean}

    def declared(argument: str) -> Any:
        kind, indices = kinds[argument[0]], int(argument[1])
        layout = "C" if argument.endswith("c") else "A"
        return numba.types.Array(kind, indices, layout, readonly=True) if indices else kind

    signature = tuple(map(declared, arguments.split()))
    for part in called:
        numba.extending.register_jitable(part)
    try:
        code: Callable[..., Any] = numba.njit(signature, cache=True, error_model="numpy")(function)
    except RuntimeError:  # there is no folder that the cache can be written to
        code = numba.njit(signature, error_model="numpy")(function)
    return code
