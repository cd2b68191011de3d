"""How figures are set on paper: keys of `[figures]` for all figures of a study, and of a `[[figure]]` for it alone."""

from __future__ import annotations

import re
from typing import Annotated, Any, ClassVar, Literal, Self, get_args

from pydantic import BeforeValidator, Field, WithJsonSchema

from nlsolve.contracts.component import Component

MILLIMETRE = 1 / 25.4  # [inch]
COLUMN, PAGE = 90 * MILLIMETRE, 180 * MILLIMETRE  # widths of one and of two columns of a journal
WIDTHS = {"single": COLUMN, "double": PAGE}
UNITS = {"mm": MILLIMETRE, "cm": 10 * MILLIMETRE, "in": 1.0, "pt": 1 / 72.27}  # [inch]; a point is that of TeX
LENGTH = re.compile(r"(\d+(?:\.\d+)?|\.\d+) ?(mm|cm|in|pt)")
LEAST, MOST = 30 * MILLIMETRE, 500 * MILLIMETRE

FONT_SIZE, RESOLUTION = 9.0, 200
Format = Literal["png", "pdf", "svg", "pgf"]
FORMATS: tuple[Format, ...] = ("png", "pdf")


def inches(width: str) -> float:
    """A width in inches: "single", "double", or a length with its unit. Raises ValueError for any other text."""
    if width in WIDTHS:
        return WIDTHS[width]
    found = LENGTH.fullmatch(width.strip())
    if found is None:
        raise ValueError(
            f"should be single, double, or a length with its unit: 84 mm, 8.4 cm, 3.3 in, 240 pt; not {width}"
        )
    length = float(found[1]) * UNITS[found[2]]
    if not LEAST <= length <= MOST:
        raise ValueError(f"{width} is no width of a figure, which has 30 to 500 mm")
    return length


def _a_width(given: Any) -> Any:
    """What is given, if it is a width: a number has no unit."""
    if isinstance(given, int | float) and not isinstance(given, bool):
        raise ValueError(f'should be a length with its unit: "{given:g} mm" or "{given:g} in"')
    if isinstance(given, str):
        inches(given)
    return given


Width = Annotated[str, BeforeValidator(_a_width)]
Formats = Annotated[
    tuple[Format, ...],
    BeforeValidator(lambda value: (value,) if isinstance(value, str) else value),
    Field(min_length=1),
    WithJsonSchema(
        {"anyOf": [{"enum": list(get_args(Format))}, {"type": "array", "items": {"enum": list(get_args(Format))}}]}
    ),
]


class Look(Component):
    """Width, fonts and files of figures; what a figure does not say is as `[figures]` says."""

    noun: ClassVar[str] = "figures"

    width: Width | None = Field(
        None,
        description="width on paper: single (90 mm), double (180 mm), or a length with its unit, in mm, cm, in or pt; "
        "absent: as wide as its kind needs, 90 to 180 mm",
    )
    font: str | None = Field(
        None, description="serif, sans-serif or the name of an installed font; in PGF that of the paper; absent: serif"
    )
    font_size: float | None = Field(
        None, ge=4, le=24, description=f"size of titles and labels [pt]; absent: {FONT_SIZE:g}, other letters by it"
    )
    formats: Formats | None = Field(None, description='format or formats of the picture; absent: ["png", "pdf"]')
    resolution: int | None = Field(None, ge=50, le=2400, description=f"dots per inch of PNG; absent: {RESOLUTION}")
    data: bool | None = Field(
        None, description="whether NAME.csv with what is drawn is written beside the picture; absent: true"
    )

    def under(self, general: Look) -> Self:
        """This look, with what it does not say as the general one says."""
        return self.with_(**{name: value for name, value in general.said.items() if getattr(self, name) is None})

    @property
    def said(self) -> dict[str, Any]:
        """What is said of the look, by key."""
        return {name: value for name in Look.model_fields if (value := getattr(self, name)) is not None}

    def wide(self, usual: float) -> float:
        """The width [inch]: the declared one, or the usual one of the kind."""
        return usual if self.width is None else inches(self.width)
