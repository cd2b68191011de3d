"""A paper's values beside ours: |m − p| ≤ tolerance |p|, or at least the same trend, or neither."""

from __future__ import annotations

from collections.abc import Callable
from typing import Annotated, Any, ClassVar

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from nlsolve.contracts.component import Component


class PublishedValues(Component):
    """A paper's values for the cells of a table, in the table's order of rows and columns."""

    noun: ClassVar[str] = "paper"

    source: str = Field(description="where the values are from")
    values: tuple[tuple[Annotated[float, Field(allow_inf_nan=True)], ...], ...] = Field(
        description="a list a row; nan where the paper has no value"
    )
    tolerance: float = Field(0.25, gt=0, description="relative difference that still counts as the same value")

    def compare(self, cells: NDArray[Any], text: Callable[[Any, int], str]) -> list[list[str]]:
        """ "measured (paper) verdict" for cells (rows, columns) of numbers, of words where a run failed, or of NaN.

        text : value, number of its column -> text.
        """
        paper = np.array(self.values)
        measured = np.array([[np.nan if isinstance(cell, str) else cell for cell in row] for row in cells], dtype=float)

        def words(i: int, j: int) -> str:
            ours = text(cells[i, j], j)
            if np.isnan(paper[i, j]):
                return ours
            return f"{ours} ({text(paper[i, j], j)}) {verdict(measured, paper, i, j, self.tolerance)}"

        return [[words(i, j) for j in range(paper.shape[1])] for i in range(paper.shape[0])]


def verdict(measured: NDArray[Any], paper: NDArray[Any], i: int, j: int, tolerance: float) -> str:
    """ "within …" the tolerance; else "same trend" when, towards every neighbour, m and p change in one direction.

    measured, paper : (rows, columns) arrays, NaN where there is no number.
    """
    m, p = measured[i, j], paper[i, j]
    if abs(m - p) <= tolerance * abs(p):
        return f"within {100 * tolerance:.3g} %"
    signs = [
        (np.sign(measured[k, n] - m), np.sign(paper[k, n] - p))
        for k, n in [(i - 1, j), (i + 1, j), (i, j - 1), (i, j + 1)]
        if 0 <= k < paper.shape[0] and 0 <= n < paper.shape[1] and not np.isnan(measured[k, n] + paper[k, n])
    ]
    agree = bool(signs) and not np.isnan(m) and all(ours == theirs for ours, theirs in signs)
    return "same trend" if agree else "differs"
