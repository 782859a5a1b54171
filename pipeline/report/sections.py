"""The kinds of section that the report page has beside tables: rows of pictures with a legend, and drawings."""

from base64 import b64encode
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pipeline.core.results import DesignSide
from pipeline.report import tables
from pipeline.report.colormap import ColourScale

#: Rectangles that the colour legend is drawn with.
LEGEND_STEPS = 60
#: Share of half the legend: a tick nearer to zero than this has no room for its label.
MIN_TICK_SHARE = 0.18


@dataclass(frozen=True, slots=True)
class Legend:
    """colours : from left to right; ticks : (share of the width, words); words : what the colours mean"""

    colours: Sequence[str]
    ticks: Sequence[tuple[float, str]]
    words: str


@dataclass(frozen=True, slots=True)
class Pictures:
    """A row of pictures, two beside each other; images : (caption, PNG)"""

    title: str
    alt: str
    images: Sequence[tuple[str, bytes]]
    note: str = ""
    legend: Legend | None = None
    kind: str = "pictures"

    @property
    def encoded(self) -> list[tuple[str, str]]:
        return [(name, b64encode(data).decode()) for name, data in self.images]


@dataclass(frozen=True, slots=True)
class Drawing:
    """An SVG. full : across the whole page on paper too, or so that two have room on one"""

    title: str
    data: bytes
    full: bool = False
    kind: str = "drawing"

    @property
    def encoded(self) -> str:
        return b64encode(self.data).decode()


Section = Pictures | Drawing | tables.Table


SIGNS: dict[DesignSide, str] = {
    "closed": "",
    "open": " The design is open: + is the side that its faces look to.",
    "none": "",
}


def legend(scale: ColourScale, sign: DesignSide, *, rejected: bool = False) -> Legend:
    """The scale in mm. rejected : of a pose that is none, where a distance says nothing about the print"""
    middles = (np.arange(LEGEND_STEPS) + 0.5) / LEGEND_STEPS * 2 - 1
    words = "Blue: material is missing. Red: there is too much."
    if rejected:
        words = "Blue: inside of the design. Red: outside."
    if sign == "none":
        words = "Red: away from the design. Its faces look to no common side: distances have no sign here."
    words += " Dark grey: on an open border, not counted. Beyond the ends: the end colours."
    if scale.tolerance_mm is not None:
        words += f" Light grey: within the tolerance of ±{scale.tolerance_mm:g} mm."
    return Legend(
        [tables.hex_of(each) for each in scale.colours(middles * scale.limit_mm)],
        _ticks(scale),
        words + SIGNS[sign],
    )


def _ticks(scale: ColourScale) -> list[tuple[float, str]]:
    """Of the ends, zero and the tolerance; where the three in the middle would lie on each other, of quarters."""
    inner = 0.5 if scale.tolerance_mm is None else scale.tolerance_mm / scale.limit_mm
    zero = "0"
    if inner < MIN_TICK_SHARE:
        inner, zero = 0.5, f"±{scale.tolerance_mm:g} mm"
    marks = (-1.0, -inner, 0.0, inner, 1.0)
    return [((mark + 1) / 2, f"{mark * scale.limit_mm:+.3g} mm" if mark else zero) for mark in marks]
