"""Sections of the report page other than tables: pictures with a legend, and drawings."""

from base64 import b64encode
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pipeline.core.results import DesignSide
from pipeline.report import tables
from pipeline.report.colormap import ColourScale
from pipeline.report.numbers import MINUS
from pipeline.report.shots import Shot
from pipeline.report.words import ENGLISH, Words

#: Rectangles that the colour legend is drawn with.
LEGEND_STEPS = 60
#: Share of half the legend: a tick nearer to zero than this has no room for its label.
MIN_TICK_SHARE = 0.18


@dataclass(frozen=True, slots=True)
class Legend:
    """colours : `#rrggbb` from left to right; ticks : (share of the width, label); words : what the colours
    mean
    """

    colours: Sequence[str]
    ticks: Sequence[tuple[float, str]]
    words: str


@dataclass(frozen=True, slots=True)
class Pictures:
    """Pictures in two columns. alt : start of the alternative text"""

    title: str
    alt: str
    images: Sequence[Shot]
    note: str = ""
    legend: Legend | None = None
    kind: str = "pictures"

    @property
    def encoded(self) -> list[tuple[Shot, str]]:
        return [(shot, b64encode(shot.data).decode()) for shot in self.images]


@dataclass(frozen=True, slots=True)
class Drawings:
    """SVGs beside each other. drawings : (caption, SVG); full : one that takes the width of the page"""

    title: str
    drawings: Sequence[tuple[str, bytes]]
    note: str = ""
    full: bool = False
    kind: str = "drawings"

    @property
    def encoded(self) -> list[tuple[str, str]]:
        return [(caption, b64encode(data).decode()) for caption, data in self.drawings]


@dataclass(frozen=True, slots=True)
class Heading:
    """The title of the sections that follow."""

    title: str
    note: str = ""
    kind: str = "heading"


Section = Pictures | Drawings | Heading | tables.Table | tables.Line


#: What the two ends of the scale mean, by the sign of the distances.
MEANINGS: dict[DesignSide, str] = {
    "closed": "Blue: material is missing. Red: excess material.",
    "open": "Blue: below the surface of the design. Red: above it, on the side of its face normals.",
    "none": "Red: away from the design. Its faces have no consistent orientation, so distances have no sign.",
}


def legend(scale: ColourScale, sign: DesignSide, *, rejected: bool = False, words: Words = ENGLISH) -> Legend:
    """The legend in mm. rejected : the pose is a rejected one, so the distances do not describe the print"""
    middles = (np.arange(LEGEND_STEPS) + 0.5) / LEGEND_STEPS * 2 - 1
    said = words(MEANINGS[sign])
    if rejected and sign == "closed":
        said = words("Blue: inside the design. Red: outside.")
    said += " " + words("Dark grey: on an open border, not counted.")
    if scale.tolerance_mm is not None:
        said += " " + words("Light grey: within ±{size} mm.", size=words.short(scale.tolerance_mm))
    return Legend(
        [tables.hex_of(each) for each in scale.colours(middles * scale.limit_mm)], _ticks(scale, words), said
    )


def _ticks(scale: ColourScale, words: Words) -> list[tuple[float, str]]:
    """Ticks at the limits, zero and the tolerance; at half the limits if the tolerance is near zero."""
    inner = 0.5 if scale.tolerance_mm is None else scale.tolerance_mm / scale.limit_mm
    zero = "0"
    if inner < MIN_TICK_SHARE:
        inner, zero = 0.5, f"±{words.local(f'{scale.tolerance_mm:g}')} mm"
    marks = (-1.0, -inner, 0.0, inner, 1.0)
    return [
        (
            (mark + 1) / 2,
            f"{words.local(f'{mark * scale.limit_mm:+.3g}')} mm".replace("-", MINUS) if mark else zero,
        )
        for mark in marks
    ]
