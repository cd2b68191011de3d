"""R(v) = W ρ ((v − v_k)/Δt + (v·∇) v) − S s(B v) − S_θ (λ B_θ v − p) − W f : the discrete balance of momentum.

It holds at the interior nodes; W are the areas of their material in a conservative form, 1 in a strong one. Terms that
the scene leaves out are absent, not zero. The same formula runs on arrays and on series.
"""

from nlsolve.flow.momentum.flow import Flow, Inertia

__all__ = ["Flow", "Inertia"]
