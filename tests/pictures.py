"""What the tests of figures draw: an annulus of nodes with a known field, and the results of a few cases."""

from __future__ import annotations

from typing import Any

import numpy as np
import pandas as pd
from matplotlib.figure import Figure
from pydantic import TypeAdapter

from nlsolve.results.columns import FIELDS
from nlsolve.show.figures import BaseFigure, FigureSpec, draw

ADAPTER: TypeAdapter[BaseFigure] = TypeAdapter(FigureSpec)
INNER, OUTER, RINGS = 1.5, 6.0, 7


def cloud() -> tuple[np.ndarray, np.ndarray]:
    """A coarse annulus: nodes (N, 2), boundary group of each."""
    places, groups = [], []
    for number, radius in enumerate(np.linspace(INNER, OUTER, RINGS)):
        angles = 2 * np.pi * np.arange(count := int(2 * np.pi * radius / 0.75)) / count
        places.append(radius * np.stack([np.cos(angles), np.sin(angles)], axis=1))
        groups += [{0: "tool", RINGS - 1: "plate"}.get(number, "")] * count
    return np.concatenate(places), np.array(groups)


def snapshot(case: str, time: float) -> pd.DataFrame:
    """Spin field u_θ = 150 (r/1.5)^(-10), 2 % too fast beside its "exact" value, on nodes turned by `time` rad."""
    start, groups = cloud()
    turn = np.array([[np.cos(time), -np.sin(time)], [np.sin(time), np.cos(time)]])
    x, y = (start @ turn.T).T
    r = np.hypot(x, y)
    speed = 150 * (r / INNER) ** -10
    values = {name: np.zeros(len(r)) for name in FIELDS}
    values |= {
        "x0": start[:, 0],
        "y0": start[:, 1],
        "x": x,
        "y": y,
        "exact_u": -speed * y / r,
        "exact_v": speed * x / r,
        "marker_x": np.full(len(r), np.nan),
        "marker_y": np.full(len(r), np.nan),
    }
    values |= {"u": 1.02 * values["exact_u"], "v": 1.02 * values["exact_v"], "rate": 11 * speed / r / np.sqrt(3)}
    return pd.DataFrame(values | {"case": case, "time": time, "node": np.arange(len(r)), "boundary": groups})


def results() -> dict[str, pd.DataFrame]:
    """Four cases of 60 increments; the last diverged and left no fields."""
    cases = [
        ("a", "anm", 10.0, 1e-6),
        ("b", "anm", 20.0, 1e-6),
        ("c", "anm", 20.0, 1e-8),
        ("d", "newton", np.nan, np.nan),
    ]
    runs = pd.DataFrame(cases, columns=["case", "solver.kind", "solver.order", "solver.tolerance"])
    runs["status"] = ["converged"] * 3 + ["diverged"]
    runs["tangents"] = [208, 88, 94, 2252]
    runs["velocity_error"] = np.nan
    runs["time.increment"] = 0.01
    time = np.repeat(np.arange(1, 61) * 0.01, 2)
    steps = [
        pd.DataFrame(
            {
                "case": case,
                "time": time,
                "step": np.tile([0, 1], 60),
                "accepted": np.tile([False, True], 60),
                "range": np.nan if kind == "newton" else 1 + order / 20 * (time * 7 % 1),
                "residual_norm": 1e-8 * (1 + time),
                "probe_u": np.cos(time),
                "probe_v": np.sin(time),
            }
        )
        for case, kind, order, _ in cases
    ]
    fields = [snapshot(case, time) for case in "abc" for time in (0.0, 0.3, 0.6)]
    return {"runs": runs, "steps": pd.concat(steps), "fields": pd.concat(fields)}


def spec_of(**given: Any) -> BaseFigure:
    return ADAPTER.validate_python({"name": "picture", **given})


def picture(frames: dict[str, pd.DataFrame], **spec: Any) -> Figure:
    return draw(spec_of(**spec), **frames)


def legend(figure: Figure) -> list[str]:
    return [text.get_text() for each in figure.legends for text in each.get_texts()]
