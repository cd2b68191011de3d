"""The files of a figure: its picture in each format, the data that it shows, and its animation; the same every time."""

from __future__ import annotations

from io import BytesIO
from pathlib import Path
from typing import Any

from nlsolve.show import plotting
from nlsolve.show.figures.paper.look import FORMATS, RESOLUTION, Format, Look
from nlsolve.show.figures.paper.tex import ENGINES, PREAMBLE, engine, texts_in_tex
from nlsolve.show.figures.style import FONTS, style_of
from nlsolve.show.provenance import Mark

PREAMBLE_FILE = "preamble.tex"
PACKAGES = ("pgf",)
WITHOUT_DATES: dict[Format, dict[str, Any]] = {"pdf": {"CreationDate": None}, "svg": {"Date": None}}
"""The time of day would make other bytes every time."""


def save(
    figure: plotting.Figure, folder: Path, name: str, look: Look | None = None, mark: Mark | None = None
) -> list[Path]:
    """Write the pictures of a figure into the folder, NAME.png and NAME.pdf unless the look says otherwise.

    mark : where it comes from, for its metadata; comments of a PGF.
    Pictures that cannot be made here are left out, see `missing`. Returns the paths. Raises ValueError where TeX cannot
    set a text of a figure in PGF.
    """
    look = look or Look()
    folder.mkdir(parents=True, exist_ok=True)
    paths = []
    for form in look.formats or FORMATS:
        if missing(form):
            continue
        paths.append(folder / f"{name}.{form}")
        with plotting.rc_context(style_of(look)):
            if form == "pgf":
                _save_pgf(figure, paths[-1], look)
                if mark is not None:
                    paths[-1].write_text(mark.around(paths[-1].read_text("utf-8"), PACKAGES), encoding="utf-8")
            else:
                said = {**WITHOUT_DATES.get(form, {}), **({} if mark is None else mark.metadata(form))}
                figure.savefig(paths[-1], dpi=look.resolution or RESOLUTION, metadata=said)
    if "pgf" in (look.formats or ()) and not missing("pgf"):
        (folder / PREAMBLE_FILE).write_text(PREAMBLE, encoding="utf-8")
    return paths


def as_png(figure: plotting.Figure, look: Look) -> bytes:
    """The picture of a figure for a screen."""
    content = BytesIO()
    with plotting.rc_context(style_of(look)):
        figure.savefig(content, format="png", dpi=RESOLUTION)
    return content.getvalue()


def missing(form: str) -> str:
    """What a format needs and this machine does not have, with the way out; empty where it can be written."""
    if form == "pgf" and engine() is None:
        engines = ", ".join(ENGINES[:-1]) + f" or {ENGINES[-1]}"
        return f"PGF needs an engine of TeX to measure its texts ({engines}), and none is installed"
    if form == "mp4" and not plotting.FFMpegWriter.isAvailable():
        return "MP4 needs the program ffmpeg, which is not installed; gif and apng need nothing"
    return ""


def _save_pgf(figure: plotting.Figure, path: Path, look: Look) -> None:
    family = look.font if look.font in FONTS else "serif"
    with (
        plotting.rc_context({"pgf.texsystem": engine(), "pgf.rcfonts": False, "pgf.preamble": ""}),
        texts_in_tex(figure, str(family)),
    ):
        figure.savefig(path)
