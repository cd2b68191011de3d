"""A moving picture of the nodes: a frame a recorded time, all in one window and with one scale of colours."""

from __future__ import annotations

from pathlib import Path

from nlsolve.results.frames import Frames
from nlsolve.show import plotting
from nlsolve.show.figures.cases import select
from nlsolve.show.figures.nodes.panels import PanelsFigure, snapshots_of
from nlsolve.show.figures.paper.look import RESOLUTION
from nlsolve.show.figures.style import style_of


def animate(spec: PanelsFigure, frames: Frames, path: Path) -> None:
    """Write the animation of a figure: its panels at each recorded time of the chosen cases.

    Raises FigureError where fewer than two times are recorded.
    """
    times = recorded_times(spec, frames)
    if len(times) < 2:
        there = f"only t = {times[0]:.6g} s is" if times else "no time is"
        raise spec.refuse(
            f"an animation needs two recorded times or more, and {there} recorded; "
            "more are recorded with record = { times = […] }"
        )
    among = snapshots_of(spec.with_(times=times, time=None, animation=None), frames, spec.columns)
    writer: plotting.AbstractMovieWriter = (
        plotting.FFMpegWriter(fps=spec.frames_per_second)
        if path.suffix == ".mp4"
        else plotting.PillowWriter(fps=spec.frames_per_second)
    )
    with plotting.rc_context(style_of(spec)):
        figure = plotting.Figure(layout="constrained")
        frame = spec.with_(times=(), time=None)  # a frame has a panel a case, whatever the strip has
        frame.show(figure, among[:: len(times)], among)
        with writer.saving(figure, str(path), spec.resolution or RESOLUTION):
            width, height = figure.get_size_inches()
            for number in range(len(times)):
                figure.clear()
                frame.show(figure, among[number :: len(times)], among)
                figure.set_size_inches(width, height)
                writer.grab_frame()


def recorded_times(spec: PanelsFigure, frames: Frames) -> tuple[float, ...]:
    """The times that all chosen cases with nodes have recorded, in their order."""
    fields = frames.fields
    spec.require("time", fields, "fields")
    cases = select(spec, frames.runs)["case"]
    recorded = [fields.loc[fields["case"] == case, "time"].dropna().unique() for case in cases]
    by_case = [{f"{time:.9g}": float(time) for time in times} for times in recorded if len(times)]
    common = set.intersection(*map(set, by_case)) if by_case else set()
    return tuple(sorted(by_case[0][time] for time in common))
