"""The figures of both studies, `study.svg`. The same study gives the same bytes.

matplotlib is imported when a figure is drawn, and only its object interface is used: no global figure, no
display.
"""

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from pipeline.core.results import RepeatabilityProtocol, RepeatabilityRow
from pipeline.core.settings import Detector
from pipeline.kernels.copy_icp import RULES
from pipeline.report import palette
from pipeline.report.words import ENGLISH, Words
from pipeline.studies.informativeness import Informativeness
from pipeline.studies.informativeness_summary import ABOVE

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.axis import Axis
    from matplotlib.figure import Figure

LABELS: dict[Detector, str] = {
    "t2": "$T^2$",
    "gaussian_curvature": "Gaussian curvature",
    "agd": "average geodesic",
    "hks": "heat kernel",
    "iss": "ISS",
    "gp": "Gaussian process",
    "farthest": "farthest point",
    "random": "random",
}
RULE_LABELS = {"library": "ICP, stopping rule of the library", "converged": "ICP to convergence"}
_DASHES = ("-", "--", "-.", ":")  # with the colour, so that no two lines differ in colour alone
# Okabe & Ito, "Color universal design" (2008): distinguishable with colour vision deficiency
_WORSE, _TIE, _BETTER, _OTHER = "#D55E00", "#CCCCCC", "#0072B2", "#56B4E9"
_MAX_STEPS = 500  # points of a curve: limits the size of the file
_ENDS = 6  # limit of log10 K on the axis: beyond it one of the two errors is a rounding error
_BAR_INCH = 0.3


def write_informativeness(path: Path, study: Informativeness, words: Words = ENGLISH) -> None:
    _write(path, lambda: draw_informativeness(study, words))


def write_repeatability(
    path: Path, protocol: RepeatabilityProtocol, rows: Sequence[RepeatabilityRow], words: Words = ENGLISH
) -> None:
    _write(path, lambda: draw_repeatability(protocol, rows, words))


def _write(path: Path, draw: Callable[[], "Figure"]) -> None:
    import matplotlib

    with matplotlib.rc_context():
        matplotlib.rcdefaults()  # not what a matplotlibrc of this machine says
        matplotlib.rcParams["svg.hashsalt"] = "cusp"
        draw().savefig(path, format="svg", metadata={"Date": None})


def draw_informativeness(study: Informativeness, words: Words = ENGLISH) -> "Figure":
    """One row of panels for each stopping rule: distribution of K without ties; shares of better, worse and
    ties.
    """
    from matplotlib.figure import Figure

    height = len(RULES) * (1.9 + _BAR_INCH * len(study.landmarks)) + 0.8
    figure = Figure(figsize=(9.6, height), layout="constrained")
    panels = figure.subplots(len(RULES), 2, width_ratios=(1.5, 1), squeeze=False)
    for rule, (curves, bars) in enumerate(panels):
        _draw_curves(curves, study, rule, words)
        _draw_shares(bars, study, rule, words)
    lines, labels = panels[0, 0].get_legend_handles_labels()
    figure.legend(lines, labels, loc="outside lower center", ncols=4, fontsize=8, frameon=False)
    moved = words("moved by up to {noise} mm", noise=words.short(study.noise_mm))
    if study.rotation_deg > 0:
        moved += words(", rotated by up to {angle}°", angle=words.local(f"{study.rotation_deg:g}"))
    figure.suptitle(
        words(
            "Landmarks alone against the complete shape: {trials} trials, {moved}",
            trials=words.count(len(study.angle_deg)),
            moved=moved,
        ),
        fontsize=11,
    )
    return figure


def _draw_curves(axes: "Axes", study: Informativeness, rule: int, words: Words) -> None:
    """Share of all trials with a smaller K: a curve ends at one minus the share of ties."""
    trials = len(study.angle_deg)
    for detector in study.landmarks:
        k = study.k(detector)[~study.ties(detector)[:, rule], rule]
        log_k = np.clip(np.log10(np.sort(np.maximum(k, np.finfo(np.float64).tiny))), -_ENDS, _ENDS)
        shown = np.unique(np.linspace(0, len(k) - 1, min(len(k), _MAX_STEPS)).astype(np.int64))
        number = list(LABELS).index(detector)
        axes.step(
            np.concatenate([[-_ENDS], log_k[shown], [_ENDS]]),
            np.concatenate([[0], shown + 1, [len(k)]]) / trials,
            where="post",
            color=tuple(palette.of_segment(number).tolist()),
            linestyle=_DASHES[number % len(_DASHES)],
            linewidth=1.8,
            label=words(LABELS[detector]),
            gid=f"k-{RULES[rule]}-{detector}",
        )
    untied = max(1 - float(study.ties(detector)[:, rule].mean()) for detector in study.landmarks)
    if untied == 0:
        tie = words("every trial is a tie")
        axes.text(0, 0.5, tie, ha="center", va="center", backgroundcolor="white", color="0.3")
    axes.axvline(0.0, color="0.3", linewidth=0.8, zorder=1)
    axes.set_xlim(-_ENDS - 0.2, _ENDS + 0.2)
    ticks = list(range(-_ENDS, _ENDS + 1, 2))
    axes.set_xticks(ticks, labels=[rf"$\leq${ticks[0]}", *map(str, ticks[1:-1]), rf"$\geq${ticks[-1]}"])
    axes.set_ylim(0, 1.03 * untied or 1.0)
    axes.set_title(words(RULE_LABELS[RULES[rule]]), loc="left", fontsize=10)
    meaning = words("ties excluded; > 0: landmarks alone are better")
    axes.set_xlabel(rf"$\log_{{10}} K$, {meaning}", fontsize=9)
    axes.set_ylabel(words("share of all trials up to K"), fontsize=9)
    _local_ticks(axes.yaxis, words)
    axes.grid(True, color="0.9", linewidth=0.6)
    axes.set_axisbelow(True)


def _draw_shares(axes: "Axes", study: Informativeness, rule: int, words: Words) -> None:
    for row, detector in enumerate(study.landmarks):
        k, tie = study.k(detector)[:, rule], study.ties(detector)[:, rule]
        better, tied = float(np.mean((k > ABOVE) & ~tie)), float(np.mean(tie))
        left = 0.0
        for share, colour, name in (
            (1 - better - tied, _WORSE, "worse"),
            (tied, _TIE, "tie (both exact up to rounding)"),
            (better, _BETTER, "better"),
        ):
            label = words(name) if row == 0 else None
            axes.barh(row, share, left=left, height=0.7, color=colour, label=label)
            if share > 0.08:  # otherwise the number is wider than its bar
                ink = "black" if colour == _TIE else "white"
                at = left + share / 2
                axes.text(at, row, words.percent(share, 0), ha="center", va="center", fontsize=8, color=ink)
            left += share
    _name_bars(axes, list(study.landmarks), words)
    axes.set_xlim(0, 1)
    axes.set_xlabel(words("share of trials in which landmarks alone are"), fontsize=9)
    _local_ticks(axes.xaxis, words)
    if rule == 0:
        axes.legend(
            loc="lower right",
            bbox_to_anchor=(1.0, 1.0),
            ncols=3,
            fontsize=8,
            frameon=False,
            columnspacing=1.0,
            borderpad=0,
        )


def draw_repeatability(
    protocol: RepeatabilityProtocol, rows: Sequence[RepeatabilityRow], words: Words = ENGLISH
) -> "Figure":
    """One panel for each condition, one bar for each detector with a mark at the chance level."""
    from matplotlib.figure import Figure

    detectors = list(dict.fromkeys(row.detector for row in rows))
    width = 2.2 + 2.6 * len(protocol.conditions)
    figure = Figure(figsize=(width, 1.7 + _BAR_INCH * len(detectors)), layout="constrained")
    panels = figure.subplots(1, len(protocol.conditions), sharey=True, squeeze=False)[0]
    for panel, (axes, condition) in enumerate(zip(panels, protocol.conditions, strict=True)):
        group = {row.detector: row for row in rows if row.condition == condition}
        for number, detector in enumerate(detectors):
            row = group[detector]
            first = number == 0
            axes.barh(
                *(number, row.mean),
                height=0.7,
                color=_BETTER if detector == "t2" else _OTHER,
                gid=f"mean-{panel}-{detector}",
            )
            axes.plot(
                *([row.chance, row.chance], [number - 0.42, number + 0.42]),
                color="black",
                linewidth=1.8,
                label=words("random points, by chance") if first else None,
            )
            at = max(row.mean, row.chance)
            axes.text(at + 0.02, number, words.fixed(row.mean, 2), ha="left", va="center", fontsize=8)
        axes.set_xlim(0, 1.12)
        axes.set_xticks([0, 0.25, 0.5, 0.75, 1.0], labels=["0", "", words.local("0.5"), "", "1"])
        axes.set_title(words.sentence(condition), loc="left", fontsize=10)
        axes.tick_params(axis="y", length=0)
        axes.grid(True, axis="x", color="0.9", linewidth=0.6)
        axes.set_axisbelow(True)
    _name_bars(panels[0], detectors, words)
    figure.supxlabel(
        words(
            "share of {count} points found again within {eps_mm} mm ({eps} of the diagonal), mean of "
            "{trials} trials",
            count=protocol.count,
            eps_mm=words.short(protocol.eps_mm),
            eps=words.percent(protocol.eps),
            trials=protocol.trials,
        ),
        fontsize=9,
    )
    lines, labels = panels[0].get_legend_handles_labels()
    figure.legend(lines, labels, loc="outside upper right", fontsize=8, frameon=False)
    return figure


def _name_bars(axes: "Axes", detectors: Sequence[Detector], words: Words) -> None:
    axes.set_yticks(range(len(detectors)), labels=[words(LABELS[detector]) for detector in detectors])
    axes.set_ylim(len(detectors) - 0.4, -0.6)  # the first on top


def _local_ticks(axis: "Axis", words: Words) -> None:
    """Numbers with the decimal mark of the language; those of English are matplotlib's own."""
    if words != ENGLISH:
        axis.set_major_formatter(lambda value, _: words.local(f"{value:.3g}"))
