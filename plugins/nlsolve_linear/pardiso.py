"""Supernodal LU, and LLᵀ or LDLᵀ for symmetric tangents, by oneMKL PARDISO (Schenk & Gärtner 2004): extra
nlsolve[pardiso].

The analysis of a pattern is taken from the previous factors as long as the pattern is the same. PARDISO then overwrites
those, and it perturbs pivots that vanish without a word: `PardisoFactors` restores what was overwritten, and holds
every factorisation against its matrix.
"""

from __future__ import annotations

from typing import Any, ClassVar, Literal

import numpy as np
import scipy.sparse as sp
from pydantic import Field

from nlsolve.plugin import Factors, LinearSolver, SolveError, Status
from nlsolve_linear.equilibrium import equilibrated, even_by_diagonal, is_symmetric
from nlsolve_linear.layout import Layout, laid_out

try:
    import pymklpardiso as mkl
except ImportError:  # an extra: nlsolve[pardiso]
    mkl = None

ABSENT = "needs the library py-mkl-pardiso, for x86-64 only: pip install 'nlsolve[pardiso]'"

LU, MATCHED_LU, LDLT, LLT = "lu", "matched lu", "ldlt", "llt"

# PARDISO's parameters, counted from zero. Pivots below 10⁻¹³ of the norm are perturbed; scaling and matching for a
# matched LU, pivots of Bunch & Kaufman (1977) for LDLᵀ, none beyond those of the diagonal blocks for LU and LLᵀ; the
# entries of the factors are counted. No refinement: the ledger refines.
PARAMETERS: dict[str, dict[int, int]] = {
    LU: {9: 13, 10: 0, 12: 0, 17: -1},
    MATCHED_LU: {9: 13, 10: 1, 12: 1, 17: -1},
    LDLT: {9: 13, 17: -1, 20: 1},
    LLT: {17: -1},
}
ORDERING, PERTURBED, ENTRIES = 1, 13, 17
"""Where PARDISO is told which ordering to take, and where it tells how many pivots it has perturbed and how many
entries the factors hold.
"""

MINIMUM_DEGREE, DISSECTION = (0, "minimum degree"), (2, "metis")
"""Orderings, with their names."""

FEW = 450_000
"""Entries of a matrix up to which minimum degree serves: factors of a new pattern take 0.4 to 0.9 of their time with a
dissection by METIS, and have as many entries within 12 %. Chosen on graded rings, judged on even ones
(`benchmarks/linear.py --orderings`).
"""

ACCURATE = {LU: 1e-12, MATCHED_LU: 1e-9, LDLT: 1e-9, LLT: 1e-9}
"""Largest ‖b − A x‖ over the size of its terms of factors that solve what they were made for; what an LU leaves beyond
that is matched.
"""

REACHED = 1e-6
"""The same over ‖b‖ where a pivot was perturbed or, in LLᵀ, may be mere rounding: a singular matrix does not reach
every b.
"""

SINGULAR = 1.0 / float(np.finfo(float).eps)
"""‖A‖ ‖x‖ over ‖b‖ above which A is singular to working precision."""


class _Analysed:
    """One pattern with its analysis in the library, and the factors that this holds now."""

    def __init__(self, kind: str, layout: Layout, matrix: Any) -> None:
        general = mkl.MTYPE_REAL_NONSYM
        types = {
            LU: general,
            MATCHED_LU: general,
            LDLT: mkl.MTYPE_REAL_SYM_INDEF,
            LLT: mkl.MTYPE_REAL_SYM_POSDEF,
        }
        ordering, self.ordering = MINIMUM_DEGREE if layout.entries <= FEW else DISSECTION
        # Its constructor looks at a symmetric matrix row by row, which takes longer than the analysis: it gets one row.
        # The pattern is set in what it wraps; tests hold every release against this.
        one = sp.csr_array(np.ones((1, 1)))
        self.solver: Any = mkl.PardisoSolver(one, types[kind], iparms={ORDERING: ordering, **PARAMETERS[kind]})
        starts, columns = (part.astype(np.int64) for part in (matrix.indptr, matrix.indices))
        self.solver._solver.set_pattern(ia=starts, ja=columns, n=matrix.shape[0])
        self.solver.set_iparm(ENTRIES, PARAMETERS[kind][ENTRIES])  # has become the number of entries of one row
        self.solver.factor(matrix.data)
        self.kind, self.layout = kind, layout
        self._held = matrix.data

    def hold(self, values: np.ndarray, anew: bool = False) -> None:
        """Make the library hold the factors of these values, with a new analysis if wanted."""
        if values is self._held and not anew:
            return
        self._held = None  # what fails leaves nothing to be held
        if anew:
            self.solver.factor(values)
        else:
            self.solver.refactor(values)
        self._held = values


class PardisoFactors(Factors):
    """L and U, L and D, or L alone of one matrix."""

    def __init__(self, compressed: Any, detect: bool, previous: Factors | None) -> None:
        earlier = previous._library if isinstance(previous, PardisoFactors) else None
        layout, rows = laid_out(compressed, None if earlier is None else earlier.layout)
        symmetric = detect and is_symmetric(rows)
        self._library: _Analysed
        if earlier is not None and earlier.layout is not layout:
            earlier = None
        for tried, kind in enumerate(_kinds(rows.diagonal(), symmetric, earlier), start=1):
            self.attempts = tried
            if kind == LLT:
                self._rows, self._columns, matrix = even_by_diagonal(rows)
            else:
                self._rows, self._columns, matrix = equilibrated(rows, symmetric)
            stored = layout.upper_of(matrix) if symmetric else matrix
            self._values = stored.data
            try:
                left = self._made(kind, layout, stored, matrix, earlier)
            except RuntimeError as failure:
                why = str(failure)
            else:
                if left <= ACCURATE[kind]:
                    break
                why = "its factors do not solve with the matrix"
        else:
            raise SolveError(Status.SINGULAR_TANGENT, f"PARDISO: {why}")
        self.ordering = f"{self._library.ordering}, {kind}"
        self.fill = int(self._library.solver.get_iparm_value(ENTRIES))

    def _made(self, kind: str, layout: Layout, stored: Any, matrix: Any, earlier: _Analysed | None) -> float:
        """Make the factors, with the analysis of earlier ones of the same kind; what they leave of a b, see `_left`.

        Raises RuntimeError, the library's.
        """
        norm = float(abs(matrix).sum(axis=1).max())
        if earlier is None or earlier.kind != kind:
            self._library = _Analysed(kind, layout, stored)
            return self._left(matrix, norm)
        self._library = earlier
        self._library.hold(self._values)
        left = self._left(matrix, norm)
        if left > ACCURATE[kind]:  # the analysis has the scaling and the matching of other values
            self._library.hold(self._values, anew=True)
            left = self._left(matrix, norm)
        return left

    def _left(self, matrix: Any, norm: float) -> float:
        """‖b − A x‖ over ‖A‖ ‖x‖ + ‖b‖, maximum norms, for one b; infinite where A counts as singular.

        norm : ‖A‖.
        """
        b = np.cos(np.arange(len(self._rows)))
        x = self._library.solver.solve(b)
        left, terms = np.abs(b - matrix @ x).max(), norm * np.abs(x).max()
        doubtful = self._library.kind == LLT or self._library.solver.get_iparm_value(PERTURBED) > 0
        unreached = doubtful and not left <= REACHED
        return np.inf if unreached or not terms < SINGULAR else float(left / (terms + 1.0))

    def solve(self, rhs: np.ndarray) -> np.ndarray:
        """x with A x = rhs by one pair of triangular solves, without PARDISO's refinement."""
        self._library.hold(self._values)  # factors that were lent since are made once more
        return self._columns * self._library.solver.solve(self._rows * rhs)


def _kinds(diagonal: np.ndarray, symmetric: bool, earlier: _Analysed | None) -> list[str]:
    """The factors to be tried of a matrix with this diagonal, the cheapest first: LLᵀ, which a symmetric matrix has
    where it is positive definite, and an LU without matching, which large pivots in their places allow.

    An earlier matrix of the same pattern that had none is followed by others as a rule.
    """
    cheap, sure = (LLT, LDLT) if symmetric else (LU, MATCHED_LU)
    lowest = (diagonal if symmetric else np.abs(diagonal)).min(initial=np.inf)
    return [sure] if lowest <= 0.0 or (earlier is not None and earlier.kind == sure) else [cheap, sure]


class Pardiso(LinearSolver):
    """LU with pivots within supernodes, scaled and matched where it is not exact without; for a symmetric matrix LLᵀ,
    or LDLᵀ where it is not positive definite, at half the entries. Ordered by minimum degree, or by dissection where
    there are many entries.

    Its factors give no condition: PARDISO must analyse anew before it solves with the transposed matrix.
    """

    kind: Literal["pardiso"] = "pardiso"
    symmetric: Literal["detect", "never"] = Field(
        "detect",
        description="LLᵀ or LDLᵀ for a matrix found symmetric to 1e-12, the tangent of a conservative form; or never",
    )
    absent: ClassVar[str | None] = ABSENT if mkl is None else None

    def factorize(self, matrix: Any, previous: Factors | None = None) -> PardisoFactors:
        """Factors of a sparse matrix, by the analysis of `previous` if that has the same pattern."""
        if mkl is None:
            raise SolveError(Status.NOT_APPLICABLE, f"the linear solver 'pardiso' {ABSENT}")
        if not np.isfinite(matrix.data).all():
            raise SolveError(Status.NON_FINITE, "a tangent holds numbers that are not finite")
        return PardisoFactors(matrix.tocsr(), self.symmetric == "detect", previous)
