"""Decision graph of the density peaks: delta over rho (Rodriguez & Laio 2014, figure 1B), one point per
working vertex.
"""

from pathlib import Path

import numpy as np

from pipeline.core.mesh import FloatArray
from pipeline.core.settings import SegmentationSettings
from pipeline.report import palette
from pipeline.report.chart import LEGEND_PT, Chart, Scale, css, lowered, padded
from pipeline.report.words import ENGLISH, Words
from pipeline.stages.segmentation import Segmentation

# All values of the drawing are chosen by hand, not fitted; none affects a measurement.
#: Size of the drawing and margins of the axes, points (1/72 inch).
WIDTH, HEIGHT = 576.0, 403.0
LEFT, RIGHT, TOP, BOTTOM = 66.0, 9.0, 24.0, 78.0
#: Ratio of the largest to the median rho above which the rho axis is logarithmic.
LOG_ABOVE = 30.0
#: Room beyond the largest rho of a linear axis, as a factor.
ROOM = 1.05
#: Radius of the disc of a centre, diameter of the dot of a vertex, points.
DISC_PT, DOT_PT = 4.0, 2.4
#: Font size of the numbers, points.
LABEL_PT = 7.5
#: Distance from a disc to its number, and between successive candidate positions, points.
LABEL_STEP_PT = 10.0
CORE, HALO = "#808080", "#cccccc"
_D_C, _RHO = lowered("d", "c"), '<tspan font-style="italic">\N{GREEK SMALL LETTER RHO}</tspan>'
_DELTA = '<tspan font-style="italic">δ</tspan>'
RHO_LABELS = {
    "vertex": "local density {rho}: vertices within {d_c}",
    "area": "local density {rho}: surface area within {d_c} [mm²]",
    "convexity": "local density {rho}: area around, weighted by its height on a bump [mm²]",
}
DELTA_LABEL = ("{delta}: distance along the surface", "to the nearest denser vertex [mm]")
CENTRE = "centre of a segment, with its number and colour"
METHOD_LABELS = {
    "cfsfdp": "density peaks",
    "kmeans": "K-means",
    "fuzzy_cmeans": "fuzzy C-means",
    "kmedians": "K-medians",
    "kcenters": "K-centers",
    "gaussian_mixture": "Gaussian mixture",
}


def write(
    path: Path,
    name: str,
    segmentation: Segmentation,
    settings: SegmentationSettings,
    words: Words = ENGLISH,
) -> None:
    """Write the decision graph of the mesh `name` as SVG; the same input gives the same bytes."""
    draw(name, segmentation, settings, words).write(path)


def draw(
    name: str, segmentation: Segmentation, settings: SegmentationSettings, words: Words = ENGLISH
) -> Chart:
    """The drawing; the disc of segment s has the id `centre-<s>`."""
    delta = _above_zero(segmentation.delta)
    chart = Chart(
        *(WIDTH, HEIGHT, _rho_scale(segmentation.rho)),
        Scale(*padded(float(delta.min()), float(delta.max()), log=True), HEIGHT - BOTTOM, TOP, log=True),
        words.local,
    )
    chart.grid()
    rest = np.ones(len(delta), dtype=np.bool_)
    rest[segmentation.centres] = False
    for shown, colour in ((rest & ~segmentation.halo, CORE), (rest & segmentation.halo, HALO)):
        chart.dots(_positive(segmentation.rho[shown], chart.x), delta[shown], colour, DOT_PT)
    if chart.y.low < segmentation.d_c_mm < chart.y.high:
        at = float(chart.y(segmentation.d_c_mm))
        chart.line(chart.x.start, at, chart.x.end, at, "#333", 1.0, dash="4 2")
    _draw_centres(chart, segmentation, delta)
    count = len(segmentation.centres)
    title = "Decision graph of {mesh}: 1 segment by {method}"
    if count != 1:
        title = "Decision graph of {mesh}: {count} segments by {method}"
    chart.frame(
        words(title, mesh=words(name), count=count, method=words(METHOD_LABELS[settings.method])),
        words(RHO_LABELS[settings.density], rho=_RHO, d_c=_D_C),
        [words(line, delta=_DELTA) for line in DELTA_LABEL],
    )
    _draw_legend(chart, segmentation, words, is_peak=settings.method == "cfsfdp")
    return chart


def _rho_scale(rho: FloatArray) -> Scale:
    high = float(rho.max())
    if high > LOG_ABOVE * float(np.median(rho)):
        low = float(rho[rho > 0].min())
        return Scale(*padded(low, high, log=True), LEFT, WIDTH - RIGHT, log=True)
    return Scale(0.0, ROOM * high if high > 0 else 1.0, LEFT, WIDTH - RIGHT)


def _positive(rho: FloatArray, scale: Scale) -> FloatArray:
    """A vertex without weight has no place on a logarithmic axis: it is drawn at its end."""
    return np.maximum(rho, scale.low)


def _draw_centres(chart: Chart, segmentation: Segmentation, delta: FloatArray) -> None:
    """Discs in the colours of the segments, the first segment on top, and beside each its number."""
    rho = _positive(segmentation.rho[segmentation.centres], chart.x)
    at_pt = np.stack([chart.x(rho), chart.y(delta[segmentation.centres])], axis=1)
    for segment in reversed(range(len(at_pt))):
        colour = css(palette.of_segment(segment))
        chart.disc(float(at_pt[segment, 0]), float(at_pt[segment, 1]), DISC_PT, colour, f"centre-{segment}")
    for segment, (disc, offset) in enumerate(zip(at_pt, label_offsets(at_pt), strict=True)):
        x, y = (float(value) for value in disc + offset)
        if np.hypot(*offset) > 1.5 * LABEL_STEP_PT:
            chart.line(x, y, float(disc[0]), float(disc[1]), "#000", 0.5)
        wide = 0.6 * LABEL_PT * len(str(segment)) + 1.5
        chart.add(
            f'<rect x="{x - wide / 2:.1f}" y="{y - LABEL_PT / 2:.1f}" width="{wide:.1f}" height="{LABEL_PT}" '
            'fill="#fff" fill-opacity="0.9"/>'
        )
        chart.text(x, y + 0.36 * LABEL_PT, str(segment), LABEL_PT, anchor="middle")


def _draw_legend(chart: Chart, segmentation: Segmentation, words: Words, *, is_peak: bool) -> None:
    """Two columns below the axes."""
    first, second, top = LEFT + 6, LEFT + 0.45 * (WIDTH - LEFT), HEIGHT - 24
    chart.text(first + 14, top, words("vertex"), LEGEND_PT)
    chart.add(f'<circle cx="{first:.1f}" cy="{top - 3:.1f}" r="{DOT_PT / 2}" fill="{CORE}"/>')
    chart.text(first + 14, top + 14, words("vertex of the halo (border of a segment)"), LEGEND_PT)
    chart.add(f'<circle cx="{first:.1f}" cy="{top + 11:.1f}" r="{DOT_PT / 2}" fill="{HALO}"/>')
    chart.line(second - 7, top - 3, second + 7, top - 3, "#333", 1.0, dash="4 2")
    cut_off = words("cut-off distance {d_c} = {size} mm", d_c=_D_C, size=words.short(segmentation.d_c_mm))
    chart.text(second + 14, top, cut_off, LEGEND_PT)
    chart.disc(second, top + 11, DISC_PT, css(palette.of_segment(0)))
    centre = "density peak: " if is_peak else ""
    chart.text(second + 14, top + 14, words(f"{centre}{CENTRE}"), LEGEND_PT)


def label_offsets(at_pt: FloatArray) -> FloatArray:
    """(k, 2) offset of the centre of each number from its disc at `at_pt` (k, 2), both in points.

    Greedy: the nearest candidate position that covers no disc and no earlier number, or the one that covers
    the fewest.
    """
    angles = np.arange(12) * np.pi / 6
    rings = [
        LABEL_STEP_PT * (1 + ring) * np.stack([np.cos(angles), np.sin(angles)], axis=1) for ring in range(5)
    ]
    candidates = np.concatenate(rings)
    half_size = np.array([0.5 * LABEL_PT + 1.0, 0.5 * LABEL_PT])  # of a number with two digits
    placed = np.zeros((0, 2))
    for disc in at_pt:
        middles = disc + candidates
        on_discs = (np.abs(middles[:, None] - at_pt) < half_size + DISC_PT).all(axis=2).sum(axis=1)
        on_numbers = (np.abs(middles[:, None] - placed) < 2 * half_size).all(axis=2).sum(axis=1)
        placed = np.concatenate([placed, middles[[(on_discs + on_numbers).argmin()]]])
    return np.asarray(placed - at_pt, dtype=np.float64)


def _above_zero(delta: FloatArray) -> FloatArray:
    """(n,) delta with zeros replaced, for the logarithmic axis; an isolated vertex has delta 0."""
    positive = delta[delta > 0]
    return np.maximum(delta, positive.min() if positive.size else 1.0)
