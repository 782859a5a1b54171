"""Decision graph of the density peaks: delta over rho (Rodriguez & Laio 2014, figure 1B), one point per
working vertex.

matplotlib is imported only when the graph is drawn, and only its object interface is used: no global figure,
no display.
"""

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from pipeline.core.mesh import FloatArray
from pipeline.core.settings import SegmentationSettings
from pipeline.report import palette
from pipeline.stages.segmentation import Segmentation

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

SIZE_INCH = (8.0, 5.6)
MARGINS = {"left": 0.11, "right": 0.985, "top": 0.94, "bottom": 0.2}
# All values of the drawing are chosen by hand, not fitted; none affects a measurement.
#: Resolution of the points of the vertices, which are an image inside the SVG: ten thousand circles are slow.
RASTER_DPI = 200
#: Ratio of the largest to the median rho above which the rho axis is logarithmic.
LOG_ABOVE = 30.0
#: Radius of the disc of a centre, points (1/72 inch).
DISC_PT = 4.0
#: Font size of the numbers, points.
LABEL_PT = 7.5
#: Distance from a disc to its number, and between successive candidate positions, points.
LABEL_STEP_PT = 10.0
_RHO_LABEL = {
    "vertex": r"local density $\rho$: vertices within $d_c$",
    "area": r"local density $\rho$: surface area within $d_c$ [mm$^2$]",
    "convexity": r"local density $\rho$: area around, weighted by its height on a bump [mm$^2$]",
}
_METHOD_LABEL = {
    "cfsfdp": "density peaks",
    "kmeans": "K-means",
    "fuzzy_cmeans": "fuzzy C-means",
    "kmedians": "K-medians",
    "kcenters": "K-centers",
    "gaussian_mixture": "Gaussian mixture",
}


def write(path: Path, name: str, segmentation: Segmentation, settings: SegmentationSettings) -> None:
    """Write the decision graph of the mesh `name` as SVG; the same input gives the same bytes."""
    import matplotlib

    with matplotlib.rc_context():
        matplotlib.rcdefaults()  # ignores a matplotlibrc of the machine
        matplotlib.rcParams["svg.hashsalt"] = "cusp"
        # A title at a fixed height: matplotlib otherwise measures every label of the axes to place it.
        matplotlib.rcParams["axes.titley"] = 1.0
        draw(name, segmentation, settings).savefig(
            path, format="svg", dpi=RASTER_DPI, metadata={"Date": None}
        )


def draw(name: str, segmentation: Segmentation, settings: SegmentationSettings) -> "Figure":
    """The figure; the disc of segment s has the gid `centre-<s>`."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=SIZE_INCH)
    # Fixed margins: a layout engine would draw everything a second time to measure it.
    axes = figure.subplots(gridspec_kw=MARGINS)
    delta = _above_zero(segmentation.delta)
    _draw_vertices(axes, segmentation, delta)
    _draw_cut_off(axes, segmentation.d_c_mm)
    _draw_centres(axes, segmentation, delta, is_peak=settings.method == "cfsfdp")
    axes.set_yscale("log")
    axes.yaxis.set_major_formatter("{x:g}")
    axes.minorticks_off()  # half of the time of drawing, and little to read
    if segmentation.rho.max() > LOG_ABOVE * np.median(segmentation.rho):
        axes.set_xscale("log")
        axes.xaxis.set_major_formatter("{x:g}")
        axes.minorticks_off()
    else:
        axes.set_xlim(left=0)
    axes.set_xlabel(_RHO_LABEL.get(settings.density, rf"local density $\rho$ ({settings.density})"))
    axes.set_ylabel("$\\delta$: distance along the surface\nto the nearest denser vertex [mm]")
    count = len(segmentation.centres)
    words = f"{count} segment{'s' * (count != 1)} by {_METHOD_LABEL[settings.method]}"
    axes.set_title(f"Decision graph of {name}: {words}", loc="left")
    axes.grid(True, which="major", color="0.9", linewidth=0.6)
    axes.set_axisbelow(True)
    figure.legend(loc="lower center", ncols=2, fontsize=8, frameon=False)
    _number_centres(figure, axes, segmentation, delta)
    return figure


def _draw_vertices(axes: "Axes", segmentation: Segmentation, delta: FloatArray) -> None:
    rest = np.ones(len(delta), dtype=np.bool_)
    rest[segmentation.centres] = False
    core, halo = rest & ~segmentation.halo, rest & segmentation.halo
    for shown, grey, words in (
        (core, "0.5", "vertex"),
        (halo, "0.8", "vertex of the halo (border of a segment)"),
    ):
        if shown.any():
            at = (segmentation.rho[shown], delta[shown])
            axes.scatter(*at, s=5, color=grey, linewidths=0, label=words, rasterized=True)


def _draw_cut_off(axes: "Axes", d_c_mm: float) -> None:
    axes.axhline(
        d_c_mm, color="0.2", linewidth=1, linestyle="--", label=f"cut-off distance $d_c$ = {d_c_mm:.3g} mm"
    )


def _draw_centres(axes: "Axes", segmentation: Segmentation, delta: FloatArray, *, is_peak: bool) -> None:
    """Draw discs in the colours of the segments, the first segment on top."""
    words = f"{'density peak: ' if is_peak else ''}centre of a segment, with its number and colour"
    for segment in reversed(range(len(segmentation.centres))):
        centre = segmentation.centres[segment]
        axes.plot(
            *([float(segmentation.rho[centre])], [float(delta[centre])], "o"),
            markersize=2 * DISC_PT,
            markerfacecolor=tuple(palette.of_segment(segment).tolist()),
            markeredgecolor="black",
            markeredgewidth=0.6,
            label=words if segment == 0 else None,
            zorder=3,
            gid=f"centre-{segment}",
        )


def _number_centres(figure: "Figure", axes: "Axes", segmentation: Segmentation, delta: FloatArray) -> None:
    """Write the number of each segment beside its disc, without covering discs and other numbers."""
    axes.autoscale_view()  # fixes the axis limits, on which the positions depend
    rho_delta = np.stack([segmentation.rho, delta], axis=1)[segmentation.centres]
    at_pt = axes.transData.transform(rho_delta) * 72.0 / figure.dpi
    for segment, offset_pt in enumerate(label_offsets(at_pt)):
        far = np.hypot(*offset_pt) > 1.5 * LABEL_STEP_PT
        axes.annotate(
            str(segment),
            (float(rho_delta[segment, 0]), float(rho_delta[segment, 1])),
            xytext=(float(offset_pt[0]), float(offset_pt[1])),
            textcoords="offset points",
            ha="center",
            va="center",
            fontsize=LABEL_PT,
            zorder=4,
            bbox={"boxstyle": "square,pad=0.1", "facecolor": "white", "edgecolor": "none", "alpha": 0.9},
            arrowprops={"arrowstyle": "-", "linewidth": 0.5, "shrinkA": 1, "shrinkB": 0} if far else None,
        )


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
