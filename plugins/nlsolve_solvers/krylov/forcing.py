"""‖R(u) + J w‖ ≤ η ‖R(u)‖ : how well a Newton equation is worth solving (Eisenstat & Walker 1996)."""

from __future__ import annotations

from typing import Literal

GOLDEN = 0.5 * (1.0 + 5.0**0.5)  # order of convergence under choice 1
GAMMA = 0.9  # η = γ (‖R_k‖/‖R_{k−1}‖)² under choice 2
LARGEST = 0.9
REMEMBERED = 0.1  # a forcing term above this, raised to the order, is a floor for the next

Choice = Literal["linear-model", "ratio", "constant"]


def next_forcing(choice: Choice, before: float, size: float, size_before: float, predicted: float) -> float:
    """η_k from η_{k−1} = before, ‖R_k‖ = size, ‖R_{k−1}‖ = size_before and ‖R_{k−1} + J w‖ = predicted.

    linear-model : choice 1, η = |‖R_k‖ − predicted|/‖R_{k−1}‖, how far the linear model was off.
    ratio : choice 2, η = γ (‖R_k‖/‖R_{k−1}‖)².
    constant : η = before.
    """
    if choice == "constant":
        return before
    if choice == "linear-model":
        eta, floor = abs(size - predicted) / size_before, before**GOLDEN
    else:
        eta, floor = GAMMA * (size / size_before) ** 2, GAMMA * before**2
    return min(max(eta, floor) if floor > REMEMBERED else eta, LARGEST)
