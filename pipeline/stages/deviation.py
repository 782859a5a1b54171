"""Deviation of the print from its design: statistics of the signed distances of scan and design vertices."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from pipeline.core.mesh import BoolArray, FloatArray, IntArray, Mesh
from pipeline.core.results import DesignDeviation, DesignSide, Deviation, SegmentDeviation
from pipeline.core.settings import DeviationSettings
from pipeline.kernels import rigid, topology
from pipeline.kernels.nearest import nearest
from pipeline.kernels.surface import Surface
from pipeline.stages.registration import Fit


@dataclass(frozen=True, slots=True)
class Deviations:
    """Deviation of every vertex of the cleaned scan.

    signed_mm : (n,) signed distance to the design, + outside; counted : (n,) vertices in the statistics;
    summary : None if no vertex is counted
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
    """Signed distance of every scan vertex to the registered design, and area-weighted statistics.

    design_segment_of_face : (m,) segment of each design face; `by_segment` groups by the segment of the
    closest point. tolerance_mm : limit for the shares within, above and below. The SD has ddof 0, so
    rms^2 = mean^2 + sd^2; quantiles are those of the weighted distribution. If
    `settings.exclude_open_border`, vertices whose closest design point lies on an open border of the design
    are not counted: the deviation is undefined there.
    """
    sign = side_of(design.mesh)
    signed = fit.closest.distance if sign == "none" else design.signed_distance(fit.moved, fit.closest)
    counted = np.ones(len(signed), dtype=np.bool_)
    if settings.exclude_open_border:
        counted = ~design.on_open_border(fit.closest)
    weights = scan.weights() * counted
    if weights.sum() == 0:
        return Deviations(signed, counted, None)
    segment = design_segment_of_face[fit.closest.face]
    by_segment = [
        SegmentDeviation(segment=int(number), **_spread(signed, weights, members))
        for number in np.unique(segment[counted])
        if weights[members := counted & (segment == number)].sum() > 0
    ]
    summary = Deviation(
        sign=sign, by_segment=by_segment, **_distances(signed, weights, counted, tolerance_mm)
    )
    return Deviations(signed, counted, summary)


def deviation_of_design(
    scan: Mesh,
    surface: Surface | None,
    design: Surface,
    fit: Fit,
    inlier_distance_mm: float,
    tolerance_mm: float | None,
) -> DesignDeviation | None:
    """Signed distance of every design vertex to the scan, + where the scan is outside the design.

    surface : surface of the scan in its own frame, None for a point cloud. For a point cloud, a distance
    beyond `inlier_distance_mm` counts as not scanned, and the sign is the side of the design on which the
    closest point lies. Returns None if no design vertex is counted.
    """
    sign, vertices = side_of(design.mesh), design.mesh.vertices
    if surface is None:
        in_scan = rigid.transformed(rigid.inverse(fit.T_design_scan), vertices)
        distance, index = nearest(scan.vertices, in_scan)
        outward = np.einsum("kd,kd->k", fit.moved[index] - vertices, design.vertex_normals)
        signed = np.where(outward < 0, -distance, distance)
        counted = np.asarray(distance <= inlier_distance_mm)
    else:
        signed, ends_there, _ = signed_to_scan(vertices, scan, surface, fit)
        counted = ~ends_there
    weights = design.mesh.weights() * counted
    if weights.sum() == 0:
        return None
    signed = np.abs(signed) if sign == "none" else signed
    return DesignDeviation(seen=float(weights.sum()), **_distances(signed, weights, counted, tolerance_mm))


def signed_to_scan(
    points: FloatArray, scan: Mesh, surface: Surface, fit: Fit
) -> tuple[FloatArray, BoolArray, FloatArray]:
    """(k,) signed distance of places of the design to the scan, mm, + where the scan is outside the design;
    (k,) whether the scan ends there: its closest place lies on an open border; (k, 3) mm, the way to that
    place, frame of the design.

    points : (k, 3) mm, frame of the design; surface : of the scan, in its own frame
    """
    in_scan = rigid.transformed(rigid.inverse(fit.T_design_scan), points)
    closest = surface.closest(in_scan)
    inside = -surface.signed_distance(in_scan, closest)  # > 0: excess material
    # The design decides which side of an open scan is its inside.
    scan_cross = rigid.rotated(fit.T_design_scan[:3, :3], scan.face_cross_mm2())
    agrees = float(np.einsum("md,md->", scan_cross, fit.closest.normal[scan.faces[:, 0]])) >= 0
    way_mm = rigid.rotated(fit.T_design_scan[:3, :3], closest.point - in_scan)
    return inside if agrees else -inside, surface.on_open_border(closest), way_mm


def side_of(design: Mesh) -> DesignSide:
    """Meaning of a positive sign: outside ("closed"), the front of the faces ("open"), or "none" (a Moebius
    strip).
    """
    if not topology.is_coherent(design.faces):
        return "none"
    return "closed" if bool((topology.edges(design.faces).count == 2).all()) else "open"


def _distances(
    signed: FloatArray, weights: FloatArray, counted: BoolArray, tolerance_mm: float | None
) -> dict[str, Any]:
    """Fields of `results.Distances`; signed : (n,) mm; weights : (n,), 0 where not counted."""
    weights = weights / weights.sum()
    p01, p05, p50, p95, p99 = weighted_quantiles(signed, weights, np.array([0.01, 0.05, 0.5, 0.95, 0.99]))
    within = above = below = None
    if tolerance_mm is not None:
        above = float(weights[signed > tolerance_mm].sum())
        below = float(weights[signed < -tolerance_mm].sum())
        within = max(0.0, 1.0 - above - below)  # rounding
    return {
        **_spread(signed, weights, counted),
        "mean_abs_mm": float((weights * np.abs(signed)).sum()),
        "p01_mm": float(p01),
        "p05_mm": float(p05),
        "p50_mm": float(p50),
        "p95_mm": float(p95),
        "p99_mm": float(p99),
        "tolerance_mm": tolerance_mm,
        "within": within,
        "above": above,
        "below": below,
    }


def _spread(signed: FloatArray, weights: FloatArray, members: BoolArray) -> dict[str, Any]:
    """Fields of `results.Spread` over the `members` (n,)."""
    d, w = signed[members], weights[members] / weights[members].sum()
    mean = float((w * d).sum())
    return {
        "n": len(d),
        "mean_mm": mean,
        "sd_mm": float(np.sqrt((w * (d - mean) ** 2).sum())),
        "rms_mm": float(np.sqrt((w * d**2).sum())),
        "min_mm": float(d.min()),
        "max_mm": float(d.max()),
    }


def weighted_quantiles(values: FloatArray, weights: FloatArray, q: FloatArray) -> FloatArray:
    """(k,) weighted quantiles of `values` (n,) at `q` (k,): the smallest value at which the cumulated weight
    reaches q, without interpolation.
    """
    order = np.argsort(values, kind="stable")
    order = order[weights[order] > 0]
    cumulated = np.cumsum(weights[order])
    index = np.minimum(np.searchsorted(cumulated, q * cumulated[-1]), len(order) - 1)
    return np.asarray(values[order[index]], dtype=np.float64)
