"""How far the print is from its design: signed distances of the scan's vertices, in numbers."""

from dataclasses import dataclass

import numpy as np

from pipeline.kernels.surface import Surface
from pipeline.mesh import BoolArray, FloatArray, IntArray, Mesh
from pipeline.outcome import Deviation, SegmentDeviation
from pipeline.settings import DeviationSettings
from pipeline.stages.registration import Fit


@dataclass(frozen=True, slots=True)
class Deviations:
    """signed_mm : (n,) of every vertex of the cleaned scan, + outside; counted : (n,) those in the statistics;
    summary : None when no vertex is counted
    """

    signed_mm: FloatArray
    counted: BoolArray
    summary: Deviation | None


def deviation(
    scan: Mesh,
    design: Surface,
    fit: Fit,
    design_segment_of_face: IntArray,
    tolerance_mm: float | None,
    settings: DeviationSettings,
) -> Deviations:
    """Statistics are area-weighted, SD with ddof 0, so rms^2 = mean^2 + sd^2; quantiles are of the weighted
    distribution. A vertex whose closest design point lies on an open border of the design says nothing about
    the print there and is left out. `by_segment` groups by the design segment of the closest point.
    """
    signed = design.signed_distance(fit.moved, fit.closest)
    counted = np.ones(len(signed), dtype=np.bool_)
    if settings.exclude_open_border:
        counted = ~design.on_open_border(fit.closest)
    weights = scan.weights() * counted
    if weights.sum() == 0:
        return Deviations(signed, counted, None)
    weights = weights / weights.sum()
    segment = design_segment_of_face[fit.closest.face]
    return Deviations(signed, counted, _summary(signed, weights, counted, segment, tolerance_mm))


def _summary(
    signed: FloatArray, weights: FloatArray, counted: BoolArray, segment: IntArray, tolerance_mm: float | None
) -> Deviation:
    p01, p05, p50, p95, p99 = weighted_quantiles(signed, weights, np.array([0.01, 0.05, 0.5, 0.95, 0.99]))
    mean = float((weights * signed).sum())
    within = above = below = None
    if tolerance_mm is not None:
        above = float(weights[signed > tolerance_mm].sum())
        below = float(weights[signed < -tolerance_mm].sum())
        within = 1.0 - above - below
    return Deviation(
        n=int(counted.sum()),
        mean_mm=mean,
        mean_abs_mm=float((weights * np.abs(signed)).sum()),
        sd_mm=float(np.sqrt((weights * (signed - mean) ** 2).sum())),
        rms_mm=float(np.sqrt((weights * signed**2).sum())),
        min_mm=float(signed[counted].min()),
        max_mm=float(signed[counted].max()),
        p01_mm=float(p01),
        p05_mm=float(p05),
        p50_mm=float(p50),
        p95_mm=float(p95),
        p99_mm=float(p99),
        tolerance_mm=tolerance_mm,
        within=within,
        above=above,
        below=below,
        by_segment=[
            _of_segment(int(number), signed, weights, counted & (segment == number))
            for number in np.unique(segment[counted])
            if weights[counted & (segment == number)].sum() > 0
        ],
    )


def _of_segment(number: int, signed: FloatArray, weights: FloatArray, members: BoolArray) -> SegmentDeviation:
    d, w = signed[members], weights[members] / weights[members].sum()
    mean = float((w * d).sum())
    return SegmentDeviation(
        segment=number,
        n=len(d),
        mean_mm=mean,
        sd_mm=float(np.sqrt((w * (d - mean) ** 2).sum())),
        rms_mm=float(np.sqrt((w * d**2).sum())),
        min_mm=float(d.min()),
        max_mm=float(d.max()),
    )


def weighted_quantiles(values: FloatArray, weights: FloatArray, q: FloatArray) -> FloatArray:
    """Smallest value at which the cumulated weight reaches q (no interpolation)."""
    order = np.argsort(values, kind="stable")
    order = order[weights[order] > 0]
    reached = np.cumsum(weights[order])
    return np.asarray(
        values[order[np.minimum(np.searchsorted(reached, q * reached[-1]), len(order) - 1)]], dtype=np.float64
    )
