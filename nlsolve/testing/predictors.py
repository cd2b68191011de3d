"""Where an increment begins: the check of predictors."""

from __future__ import annotations

import numpy as np

from nlsolve.predictors import Predictor
from nlsolve.testing.promises import require, same


def check_predictor(predictor: Predictor) -> None:
    """A flow that stays as it is goes on as it is, to 1e-12, however few increments are known; a guess has the shape of
    the velocities, leaves them as they were, and is the same each time.
    """
    require(predictor.depth >= 1, f"a depth of {predictor.depth}: at least the last increment is looked at")
    steady = np.random.default_rng(0).standard_normal((7, 2))
    for known in range(1, predictor.depth + 1):
        past = [steady.copy() for _ in range(known)]
        guess = predictor.guess(past)
        require(guess.shape == steady.shape, f"a guess of shape {guess.shape} for velocities of {steady.shape}")
        same(guess, steady, 1.0, f"the guess of a steady flow from {known} increments", 1e-12)
        require(all(np.array_equal(v, steady) for v in past), "the predictor changed the velocities it looked at")
        require(np.array_equal(predictor.guess(past), guess), "guess changed its mind: it may look at the past only")
