"""‖v − v_exact‖ beside the estimate of the error : does the exact solution of a scene solve it?"""

from __future__ import annotations

from nlsolve.flow.claims.finding import NOTHING, Finding
from nlsolve.results.verdicts import ACCEPTED, percent


def disagreement(scene: str, error: float, estimate: float) -> Finding:
    """error / estimate where the error is not small: solutions that agree with each other far better than with the
    exact solution belie it, or have an error in common.

    scene : the kind of the scene.
    error : relative error of the velocity inside against the exact solution; NaN where there is none.
    estimate : of that error, by solutions that know nothing of the exact one; NaN without one.
    """
    if not error > ACCEPTED or not estimate > 0.0:
        return NOTHING
    return Finding(
        error / estimate,
        f"the velocity is {percent(error)} from the exact solution of the scene {scene!r}, and its error is estimated "
        f"as {percent(estimate)}: the exact solution does not solve the scene, or the estimate errs alike; check the "
        "exact solution, or choose a finer spacing",
    )
