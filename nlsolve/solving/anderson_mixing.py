"""u_{k+1} = u_k + β f_k − (ΔU + β ΔF) γ,  γ = argmin ‖f_k − ΔF γ‖₂ : Anderson's mixing of u ← u + f(u), type II.

Anderson (1965); Walker & Ni (2011), whose rule for an ill-conditioned ΔF is to forget its oldest column.
"""

from __future__ import annotations

import numpy as np
from scipy.linalg.lapack import dgeqrf, dtrcon, dtrtrs

WORST_CONDITION = 1e8  # ‖R‖₂ ‖R⁻¹‖₂ of ΔF = Q R: beyond it γ amplifies the rounding in f


class Mixing:
    """Keeps the last changes of f and of u + β f, and gives the next u.

    depth : the largest number m of changes that are kept.
    damping : β.

    ΔF, ΔU + β ΔF : (U, m), m ≤ depth; the columns are changes from one u to the next, oldest first.
    """

    def __init__(self, depth: int, damping: float) -> None:
        self._depth, self._damping = depth, damping
        self.forget()

    def forget(self) -> None:
        """Forget all changes, because f is another function from now on."""
        self._last: tuple[np.ndarray, np.ndarray] | None = None
        self._changes: list[np.ndarray] = []
        self._moves: list[np.ndarray] = []

    def next(self, u: np.ndarray, f: np.ndarray) -> np.ndarray:
        """u_{k+1} from u_k and f_k = f(u_k), shape (U,)."""
        plain = u + self._damping * f
        most = min(self._depth, len(u))  # more changes than unknowns determine no γ
        if self._last is not None and most:
            self._changes = [*self._changes, f - self._last[0]][-most:]
            self._moves = [*self._moves, plain - self._last[1]][-most:]
        self._last = f, plain
        while m := len(self._changes):
            # Of (ΔF f): beside the R of ΔF stands Qᵀ f. numpy's qr is the same routine, at twice the time.
            factored = dgeqrf(np.array([*self._changes, f]).T, overwrite_a=True)[0]
            r, projected = factored[:m, :m], factored[:m, m]  # below R stand the reflections that make up Q
            if _determines(r):
                gamma = dtrtrs(r, projected)[0]
                return plain - gamma @ np.array(self._moves)
            del self._changes[0], self._moves[0]
        return plain


def _determines(r: np.ndarray) -> bool:
    """Whether ‖R‖₂ ‖R⁻¹‖₂ is below the worst condition, for the upper triangle R (m, m).

    It is at most m times the condition in the norm of column sums, which costs less to estimate.
    """
    if WORST_CONDITION * dtrcon(r)[0] > len(r):
        return True
    sizes = np.linalg.svd(np.triu(r), compute_uv=False)
    return bool(sizes[0] < WORST_CONDITION * sizes[-1])  # not where all changes are zero
