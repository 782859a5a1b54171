"""Small charts as SVG text: two axes with ticks, and shapes on them.

A job draws two or three; a plotting library takes longer over each than the search for the pose. Lengths on
the drawing are points (1/72 inch), y downwards.
"""

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path
from xml.sax.saxutils import escape

import numpy as np

from pipeline.core.mesh import FloatArray

#: All values of the drawing are chosen by hand, not fitted; none affects a measurement.
FONT = "DejaVu Sans, Verdana, Arial, sans-serif"
TITLE_PT, LABEL_PT, TICK_PT, LEGEND_PT = 11.0, 10.0, 9.0, 8.0
#: Ticks of a linear axis, about.
TICKS = 6
#: Decades of a logarithmic axis from which its ticks are powers of ten, not also 2 and 5 times them.
MANY_DECADES = 3.0


@dataclass(frozen=True, slots=True)
class Scale:
    """From values to points. low, high : values at the ends, low < high, > 0 with log; start, end : points"""

    low: float
    high: float
    start: float
    end: float
    log: bool = False

    def __call__(self, values: FloatArray | float) -> FloatArray:
        """Points of values, in the shape of the values."""
        low, high, at = self.low, self.high, np.asarray(values, dtype=np.float64)
        if self.log:
            low, high, at = np.log10(low), np.log10(high), np.log10(at)
        return np.asarray(self.start + (at - low) / (high - low) * (self.end - self.start))

    def ticks(self) -> list[float]:
        """Round values between the ends, ascending."""
        if self.log:
            decades = np.log10(self.high / self.low)
            steps = (1, 2, 5) if decades < MANY_DECADES else (1,)
            powers = range(int(np.floor(np.log10(self.low))), int(np.ceil(np.log10(self.high))) + 1)
            found = [step * 10.0**power for power in powers for step in steps]
        else:
            rough = (self.high - self.low) / TICKS
            power = 10.0 ** np.floor(np.log10(rough))
            step = next(factor * power for factor in (1, 2, 5, 10) if factor * power >= rough)
            first, last = int(np.ceil(self.low / step)), int(np.floor(self.high / step))
            found = [number * step for number in range(first, last + 1)]
        return [value for value in found if self.low <= value <= self.high]


def padded(low: float, high: float, *, log: bool = False, share: float = 0.05) -> tuple[float, float]:
    """Limits of an axis around values from low to high, with room of `share` of it on both sides."""
    if log:
        low, high = float(np.log10(low)), float(np.log10(high))
    room = share * (high - low) if high > low else 0.5
    low, high = low - room, high + room
    return (10.0**low, 10.0**high) if log else (low, high)


class Chart:
    """Axes in a drawing of `width` x `height` points; shapes are added in the order in which they cover each
    other. local : a number as its language writes it
    """

    def __init__(
        self, width: float, height: float, x: Scale, y: Scale, local: Callable[[str], str] = str
    ) -> None:
        self.x, self.y, self._local = x, y, local
        self._size = width, height
        self._parts: list[str] = []

    def add(self, part: str) -> None:
        """SVG, in points."""
        self._parts.append(part)

    def grid(self, *, vertical: bool = True) -> None:
        """Lines at the ticks, and the labels of the ticks."""
        x, y = self.x, self.y
        for value in x.ticks():
            at = float(x(value))
            if vertical:
                self.line(at, y.start, at, y.end, "#e6e6e6", 0.6)
            self.line(at, y.start, at, y.start + 3, "#000", 0.8)
            self.text(at, y.start + 3 + TICK_PT, tick_label(value, self._local), TICK_PT, anchor="middle")
        for value in y.ticks():
            at = float(y(value))
            self.line(x.start, at, x.end, at, "#e6e6e6", 0.6)
            self.line(x.start - 3, at, x.start, at, "#000", 0.8)
            self.text(x.start - 6, at + 0.35 * TICK_PT, tick_label(value, self._local), TICK_PT, anchor="end")

    def frame(self, title: str, x_label: str, y_label: Iterable[str]) -> None:
        """The border of the axes, the title and the labels; `y_label` : lines. All may hold SVG's tspan."""
        x, y = self.x, self.y
        self.add(
            f'<rect x="{x.start:.1f}" y="{y.end:.1f}" width="{x.end - x.start:.1f}" '
            f'height="{y.start - y.end:.1f}" fill="none" stroke="#000" stroke-width="0.8"/>'
        )
        self.text(x.start, y.end - 6, title, TITLE_PT)
        self.text((x.start + x.end) / 2, y.start + 28, x_label, LABEL_PT, anchor="middle")
        middle, lines = (y.start + y.end) / 2, list(y_label)
        for number, line in enumerate(lines):
            left = 12 + 1.2 * LABEL_PT * number
            self.text(left, middle, line, LABEL_PT, anchor="middle", turned=True)

    def line(
        self, x0: float, y0: float, x1: float, y1: float, colour: str, width: float, dash: str = ""
    ) -> None:
        dashed = f' stroke-dasharray="{dash}"' if dash else ""
        self.add(
            f'<path d="M{x0:.1f} {y0:.1f}L{x1:.1f} {y1:.1f}" stroke="{colour}" stroke-width="{width:g}"'
            f'{dashed} fill="none"/>'
        )

    def text(
        self, x: float, y: float, words: str, size: float, *, anchor: str = "start", turned: bool = False
    ) -> None:
        """words : may hold SVG's tspan. turned : reads upwards"""
        turn = f' transform="rotate(-90 {x:.1f} {y:.1f})"' if turned else ""
        self.add(
            f'<text x="{x:.1f}" y="{y:.1f}" font-size="{size:g}" text-anchor="{anchor}"{turn}>{words}</text>'
        )

    def dots(self, x: FloatArray, y: FloatArray, colour: str, diameter: float) -> None:
        """Many small discs at values (k,), (k,), as one path."""
        at = np.unique(np.round(np.stack([self.x(x), self.y(y)], axis=1), 1), axis=0)
        path = "".join(f"M{column:.1f} {row:.1f}h.01" for column, row in at.tolist())
        self.add(
            f'<path d="{path}" stroke="{colour}" stroke-width="{diameter:g}" stroke-linecap="round"'
            ' fill="none"/>'
        )

    def disc(self, x: float, y: float, radius: float, colour: str, name: str = "") -> None:
        """At a point of the drawing. name : its id"""
        of_name = f' id="{name}"' if name else ""
        self.add(
            f'<circle{of_name} cx="{x:.1f}" cy="{y:.1f}" r="{radius:g}" fill="{colour}" stroke="#000"'
            ' stroke-width="0.6"/>'
        )

    def write(self, path: Path) -> None:
        """The SVG file."""
        width, height = self._size
        head = (
            f'<svg xmlns="http://www.w3.org/2000/svg" width="{width:g}pt" height="{height:g}pt" '
            f'viewBox="0 0 {width:g} {height:g}" font-family="{FONT}">'
            f'<rect width="{width:g}" height="{height:g}" fill="#fff"/>'
        )
        path.write_text("\n".join([head, *self._parts, "</svg>\n"]), encoding="utf-8")


def tick_label(value: float, local: Callable[[str], str] = str) -> str:
    """A number in SVG, with a minus sign, and powers of ten instead of e+06."""
    mantissa, _, power = local(f"{value:g}".replace("-", "\N{MINUS SIGN}")).partition("e")
    if not power:
        return mantissa
    digits = power.replace("+", "").replace("0", "", 1) if power[1] == "0" else power.replace("+", "")
    raised = f'<tspan dy="-3" font-size="75%">{digits}</tspan>'
    return f"10{raised}" if mantissa == "1" else f"{mantissa} · 10{raised}"


def lowered(letter: str, index: str) -> str:
    """A letter with an index, in SVG."""
    return (
        f'<tspan font-style="italic">{escape(letter)}</tspan><tspan dy="2.5" font-size="75%">{escape(index)}'
        '</tspan><tspan dy="-2.5">&#8203;</tspan>'
    )


def css(colour: FloatArray) -> str:
    """#rrggbb of RGB in [0, 1]."""
    return "#" + "".join(f"{round(255 * float(channel)):02x}" for channel in np.clip(colour, 0.0, 1.0))
