"""`deviation_histogram.svg`: share of the scanned area by signed distance, in the colours of the deviation
files.
"""

from pathlib import Path

import numpy as np

from pipeline.core.mesh import FloatArray
from pipeline.core.results import DesignSide, Deviation
from pipeline.report.chart import Chart, Scale, css
from pipeline.report.colormap import ColourScale
from pipeline.report.words import ENGLISH, Words

#: Bars of the histogram; odd, so that one is centred on zero.
BINS = 81
#: Size of the drawing and margins of the axes, points (1/72 inch).
WIDTH, HEIGHT = 518.0, 230.0
LEFT, RIGHT, TOP, BOTTOM = 48.0, 10.0, 26.0, 38.0
#: Font size of the names of the percentiles, points.
MARK_PT = 7.0
AXIS_LABELS: dict[DesignSide, str] = {
    "closed": "deviation [mm]: &lt; 0 missing material, &gt; 0 excess material",
    "open": "deviation [mm]: &lt; 0 below the surface of the design, &gt; 0 above it",
    "none": "distance from the design [mm], without a sign",
}
#: Room above the highest bar, as a factor.
ROOM = 1.05


def write(
    path: Path,
    signed_mm: FloatArray,
    weights: FloatArray,
    summary: Deviation,
    scale: ColourScale,
    words: Words = ENGLISH,
) -> None:
    """Write the SVG. signed_mm : (n,) mm; weights : (n,) area of each counted vertex, 0 for the others.

    The same input gives the same bytes.
    """
    draw(signed_mm, weights, summary, scale, words).write(path)


def draw(
    signed_mm: FloatArray,
    weights: FloatArray,
    summary: Deviation,
    scale: ColourScale,
    words: Words = ENGLISH,
) -> Chart:
    """The drawing; see `write`."""
    edges = np.linspace(-scale.limit_mm, scale.limit_mm, BINS + 1)
    inside = np.clip(signed_mm, edges[0], edges[-1])  # values beyond the limits go to the last bars
    share, _ = np.histogram(inside, edges, weights=weights)
    percent = 100 * share / weights.sum()
    chart = Chart(
        *(WIDTH, HEIGHT, Scale(float(edges[0]), float(edges[-1]), LEFT, WIDTH - RIGHT)),
        Scale(0.0, ROOM * float(percent.max()), HEIGHT - BOTTOM, TOP),
        words.local,
    )
    chart.grid(vertical=False)
    _draw_bars(chart, edges, percent, scale)
    for position_mm, name in (
        (summary.p05_mm, "5 %"),
        (summary.p50_mm, words("median")),
        (summary.p95_mm, "95 %"),
    ):
        if abs(position_mm) < scale.limit_mm:
            at = float(chart.x(position_mm))
            chart.line(at, chart.y.start, at, chart.y.end, "#333", 0.8, dash="1 1.5")
            chart.text(at - 2, chart.y.end + 3, name, MARK_PT, anchor="end", turned=True)
    if scale.tolerance_mm is not None and scale.tolerance_mm < scale.limit_mm:
        for side in (-1, 1):
            at = float(chart.x(side * scale.tolerance_mm))
            chart.line(at, chart.y.start, at, chart.y.end, "#000", 1.0)
    chart.frame(
        words(
            "mean {mean} mm, SD {sd} mm, RMS {rms} mm",
            mean=words.signed(summary.mean_mm),
            sd=words.fixed(summary.sd_mm),
            rms=words.fixed(summary.rms_mm),
        ),
        words(AXIS_LABELS[summary.sign]),
        (words("share of the area [%]"),),
    )
    return chart


def _draw_bars(chart: Chart, edges: FloatArray, percent: FloatArray, scale: ColourScale) -> None:
    left, top = chart.x(edges), chart.y(percent)
    colours = scale.colours((edges[:-1] + edges[1:]) / 2)
    for number in np.flatnonzero(percent > 0):
        chart.add(
            f'<rect x="{left[number]:.2f}" y="{top[number]:.2f}" '
            f'width="{left[number + 1] - left[number]:.2f}" height="{chart.y.start - top[number]:.2f}" '
            f'fill="{css(colours[number])}" stroke="#595959" stroke-width="0.3"/>'
        )
