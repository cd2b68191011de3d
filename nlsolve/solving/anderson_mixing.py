"""u_{k+1} = u_k + β f_k − (ΔU + β ΔF) γ,  γ = argmin ‖f_k − ΔF γ‖₂ : Anderson's mixing of u ← u + f(u), type II.

Anderson (1965); Walker & Ni (2011), whose rule for an ill-conditioned ΔF is to forget its oldest column.
"""

from __future__ import annotations

import numpy as np
from scipy.linalg.lapack import dgeqrf

WORST_CONDITION = 1e8  # of R in ΔF = Q R: beyond it γ amplifies the rounding in f


class Mixing:
    """Keeps the last changes of u and f, and gives the next u.

    depth : the largest number m of changes that are kept.
    damping : β.

    ΔU, ΔF : (U, m), m ≤ depth; the columns u_{j+1} − u_j and f_{j+1} − f_j, oldest first.
    """

    def __init__(self, depth: int, damping: float) -> None:
        self._depth, self._damping = depth, damping
        self.forget()

    def forget(self) -> None:
        """Forget all changes, because f is another function from now on."""
        self._last: tuple[np.ndarray, np.ndarray] | None = None
        self._states: list[np.ndarray] = []
        self._changes: list[np.ndarray] = []

    def next(self, u: np.ndarray, f: np.ndarray) -> np.ndarray:
        """u_{k+1} from u_k and f_k = f(u_k), shape (U,)."""
        most = min(self._depth, len(u))  # more changes than unknowns determine no γ
        if self._last is not None and most:
            self._states = [*self._states, u - self._last[0]][-most:]
            self._changes = [*self._changes, f - self._last[1]][-most:]
        self._last = u, f
        plain = u + self._damping * f
        while m := len(self._changes):
            rows = np.array([*self._changes, f])
            # Of (ΔF f): beside the R of ΔF stands Qᵀ f. numpy's qr is the same routine, at twice the time.
            r = np.triu(dgeqrf(rows.T)[0][: m + 1])
            left, sizes, right = np.linalg.svd(r[:m, :m])
            if sizes[0] < WORST_CONDITION * sizes[-1]:  # not where all changes are zero
                gamma = (r[:m, m] @ left / sizes) @ right
                return plain - gamma @ np.array(self._states) - self._damping * (gamma @ rows[:m])
            del self._states[0], self._changes[0]
        return plain
