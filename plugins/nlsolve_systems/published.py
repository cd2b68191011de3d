"""F(u) = 0 from the published sets: TEST_NONLIN's 23 problems, and Moré, Garbow & Hillstrom (1981)."""

from __future__ import annotations

from difflib import get_close_matches
from typing import Any, Literal

import numpy as np
from pydantic import Field, model_validator

from nlsolve.plugin import System
from nlsolve_systems.catalogue import PROBLEMS, Listed


class Published(System):
    """A problem of the catalogue, by name; formulas and sources are in `more_garbow_hillstrom` and `burkardt`."""

    kind: Literal["published"] = "published"
    problem: str = Field(description=f"one of {', '.join(PROBLEMS)}")
    size: int | None = Field(
        None, gt=0, description="U, unknowns of a problem that has several sizes; absent: as published"
    )

    @model_validator(mode="after")
    def _is_in_the_catalogue(self) -> Published:
        if self.problem not in PROBLEMS:
            nearest = get_close_matches(self.problem, PROBLEMS, n=1)
            guess = f"did you mean {nearest[0]!r}?" if nearest else f"there are {', '.join(PROBLEMS)}"
            raise ValueError(f"problem = {self.problem!r}: no such problem; {guess}")
        step, published = self.listed.step, self.listed.size
        if self.size is not None and self.size != published:
            if not step:
                raise ValueError(f"size = {self.size}: {self.problem} has {published} unknowns; leave size out")
            if self.size % step or self.size < 2:
                multiples = "2 or more" if step == 1 else f"a multiple of {step}"
                raise ValueError(f"size = {self.size}: {self.problem} can have {multiples} unknowns")
        return self

    @property
    def listed(self) -> Listed:
        """The catalogue's entry for this problem."""
        return PROBLEMS[self.problem]

    @property
    def unknowns(self) -> int:
        """`size`, or the published number of unknowns."""
        return self.size or self.listed.size

    def formula(self, u: Any) -> Any:
        """The published formula, F(u) of shape (U, …)."""
        return self.listed.formula(u)

    def standard_start(self) -> np.ndarray:
        """The published start, at any size."""
        return self.listed.start(self.unknowns)

    def pattern(self) -> Any | None:
        """Where the Jacobian of a banded problem is not zero; None for the others."""
        return None if self.listed.pattern is None else self.listed.pattern(self.unknowns)

    def roots(self) -> np.ndarray | None:
        """All known roots (K, U): in closed form, or computed for the published size; None if none is known."""
        return self.listed.roots(self.problem, self.unknowns)

    def nearest_root(self, u: np.ndarray) -> np.ndarray | None:
        """The root nearest to u, also where the roots are a set that cannot be listed."""
        if self.listed.nearest is not None and self.unknowns == self.listed.size:
            return self.listed.nearest(u)
        return super().nearest_root(u)

    @property
    def singular(self) -> bool:
        """Whether the Jacobian is singular at a known root."""
        return self.listed.singular
