"""`deviation_histogram.svg`: share of the scanned area by signed distance, in the colours of the deviation
files.

matplotlib is imported when the histogram is drawn, and only its object interface is used.
"""

from pathlib import Path

import numpy as np

from pipeline.core.mesh import FloatArray
from pipeline.core.results import Deviation
from pipeline.report.colormap import ColourScale
from pipeline.report.numbers import fixed, signed

#: Bars of the histogram; odd, so that one is centred on zero.
BINS = 81
SIZE_INCH = (7.2, 3.2)
MARGINS = {"left": 0.1, "right": 0.98, "top": 0.88, "bottom": 0.17}


def write(
    path: Path, signed_mm: FloatArray, weights: FloatArray, summary: Deviation, scale: ColourScale
) -> None:
    """Write the SVG. signed_mm : (n,) mm; weights : (n,) area of each counted vertex, 0 for the others.

    The same input gives the same bytes.
    """
    import matplotlib
    from matplotlib.figure import Figure

    with matplotlib.rc_context():
        matplotlib.rcdefaults()
        matplotlib.rcParams["svg.hashsalt"] = "cusp"
        # A title at a fixed height: matplotlib otherwise measures every label of the axes to place it.
        matplotlib.rcParams["axes.titley"] = 1.0
        figure = Figure(figsize=SIZE_INCH)
        axes = figure.subplots(gridspec_kw=MARGINS)
        edges = np.linspace(-scale.limit_mm, scale.limit_mm, BINS + 1)
        inside = np.clip(signed_mm, edges[0], edges[-1])  # values beyond the limits go to the last bars
        share, _ = np.histogram(inside, edges, weights=weights)
        middles = (edges[:-1] + edges[1:]) / 2
        colours = scale.colours(middles)
        axes.bar(
            middles,
            100 * share / weights.sum(),
            np.diff(edges),
            color=colours,
            edgecolor="0.35",
            linewidth=0.3,
        )
        for position, label in (
            (summary.p05_mm, "5 %"),
            (summary.p50_mm, "median"),
            (summary.p95_mm, "95 %"),
        ):
            if abs(position) < scale.limit_mm:
                axes.axvline(position, color="0.2", linewidth=0.8, linestyle=":")
                axes.annotate(
                    label,
                    (position, 0.985),
                    xycoords=("data", "axes fraction"),
                    rotation=90,
                    fontsize=7,
                    va="top",
                    ha="right",
                )
        if scale.tolerance_mm is not None:
            for side in (-1, 1):
                axes.axvline(side * scale.tolerance_mm, color="black", linewidth=1.0)
        axes.set_xlim(edges[0], edges[-1])
        axes.set_xlabel("deviation [mm]: < 0 missing material, > 0 excess material")
        axes.set_ylabel("share of the area [%]")
        axes.set_title(
            f"mean {signed(summary.mean_mm)} mm, SD {fixed(summary.sd_mm)} mm, "
            f"RMS {fixed(summary.rms_mm)} mm",
            loc="left",
            fontsize=10,
        )
        axes.grid(True, axis="y", color="0.9", linewidth=0.6)
        axes.set_axisbelow(True)
        figure.savefig(path, format="svg", metadata={"Date": None})
