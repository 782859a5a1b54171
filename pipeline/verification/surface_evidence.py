"""What the two surfaces say about one pose: do their normals agree, is what is left of the distances noise
and smooth distortion or a difference of shape, and where do they differ?
"""

from dataclasses import dataclass

import numpy as np

from pipeline.core.mesh import BoolArray, FloatArray, IndexArray, Mesh
from pipeline.kernels import rigid, sampling
from pipeline.kernels.nearest import nearest
from pipeline.kernels.patches import patch_means
from pipeline.kernels.pieces import Pieces
from pipeline.kernels.surface import Surface
from pipeline.kernels.surface_patches import (
    Patch,
    border_length_mm,
    largest_patch,
    neighbour_means,
    without_low_order,
)
from pipeline.stages.registration import Fit
from pipeline.verification.thresholds import DIFFERENCE

#: Standard deviations in a median absolute deviation (of the normal distribution).
SIGMA_PER_MAD = 1.4826
#: A scan with less open border than this many square roots of its area is closed. Chosen by hand.
CLOSED_BORDER_RATIO = 0.3


@dataclass(frozen=True, slots=True)
class SurfaceEvidence:
    """normal_agreement : mean cosine of the angle between the normals of scan and design over the area of the
    scan; 0 counts beyond the inlier distance; detail_mm : RMS over patches of the mean signed distance,
    without what is of low order; scan_patch : the largest patch of the scan off the design, in the design's
    frame, + outside; design_patch : the largest patch of the design that the scan should show and does
    not; each None where there is none; thickness_mm : RMS distance of the scan from its own best plane
    """

    normal_agreement: float
    detail_mm: float
    scan_patch: Patch | None
    design_patch: Patch | None
    thickness_mm: float


def assess_surfaces(
    working_scan: Mesh,
    working_of_clean: IndexArray,
    scan: Mesh,
    fit: Fit,
    normal_sign: float,
    design: Surface,
    working_design: Mesh,
    inlier_mm: float,
    accuracy_mm: float,
) -> SurfaceEvidence:
    """The evidence under one pose.

    working_scan : the working mesh of the scan, in its frame; working_of_clean : (n,) its vertex for each
    vertex of `scan`, on which `fit` is; design : exact; working_design : its working mesh; accuracy_mm :
    of the scanner as stated (1 sigma), or 0
    """
    T = fit.T_design_scan
    size_mm = design.mesh.diagonal_mm
    visible_mm = max(
        DIFFERENCE.min_sigmas * accuracy_mm,
        DIFFERENCE.min_residuals * fit.truncated_rms_mm,
        DIFFERENCE.min_size_share * size_mm,
    )
    placed = Mesh(rigid.transformed(T, working_scan.vertices), working_scan.faces)
    closest = design.closest(placed.vertices)
    cosine = normal_sign * np.einsum("kd,kd->k", placed.vertex_normals(), closest.normal)
    agrees = np.clip(cosine, 0.0, 1.0) * (closest.distance <= inlier_mm)
    signed = _signed(fit.moved, fit.closest.point, fit.closest.normal, fit.closest.distance)
    weights = scan.weights()
    signed_w, weights_w = _on_working_mesh(signed, weights, working_of_clean, len(placed.vertices))
    clipped = np.clip(signed_w, -inlier_mm, inlier_mm)
    detail = without_low_order(placed.vertices, clipped, np.maximum(weights_w, 1e-12))
    share, mean = patch_means(placed.vertices, detail, weights_w)
    limit_area_mm2 = DIFFERENCE.min_area_share * float(design.mesh.face_areas_mm2().sum())
    trend = clipped - detail
    scan_patch = _off_patch(placed, signed_w - trend, weights_w, visible_mm, limit_area_mm2)
    return SurfaceEvidence(
        normal_agreement=float(np.average(agrees, weights=np.maximum(placed.weights(), 1e-15))),
        detail_mm=float(np.sqrt((share * mean**2).sum() / max(float(share.sum()), 1e-300))),
        scan_patch=scan_patch,
        design_patch=_unseen_patch(
            placed, normal_sign, working_design, design, visible_mm, inlier_mm, limit_area_mm2
        ),
        thickness_mm=_thickness_mm(fit.moved, weights),
    )


def _thickness_mm(points: FloatArray, weights: FloatArray) -> float:
    """RMS distance of points (n, 3) from their best plane."""
    centred = points - np.average(points, axis=0, weights=weights)
    covariance = np.einsum("n,ni,nj->ij", weights, centred, centred)
    return float(np.sqrt(max(0.0, np.linalg.eigvalsh(covariance)[0])))


def _off_patch(
    mesh: Mesh, values: FloatArray, weights: FloatArray, visible_mm: float, min_area_mm2: float
) -> Patch | None:
    """The largest patch whose smoothed value stands out of what is usual on this surface, and is visible."""
    smooth = neighbour_means(mesh, values, weights, DIFFERENCE.smoothing_rounds)
    spread_mm = SIGMA_PER_MAD * float(np.median(np.abs(smooth - np.median(smooth))))
    limit_mm = max(DIFFERENCE.min_spreads * spread_mm, visible_mm)
    patch = largest_patch(mesh, smooth, np.abs(smooth) > limit_mm)
    return patch if patch is not None and patch.area_mm2 >= min_area_mm2 else None


def _unseen_patch(
    scan: Mesh,
    normal_sign: float,
    working_design: Mesh,
    design: Surface,
    visible_mm: float,
    inlier_mm: float,
    min_area_mm2: float,
) -> Patch | None:
    """The largest patch of the design that the scan should show and does not. scan : in the design's frame

    Of a closed scan any patch that lies off it. An open one leaves out what the scanner did not see: there,
    what the scanner saw past (`_seen_past`); and a whole body, where the scan shows most of the others.
    Cavities, which no scanner of surfaces sees, do not count.
    """
    surface = Surface(scan)
    visible = ~_in_cavity(working_design, design)
    distance = np.where(visible, surface.closest(working_design.vertices).distance, 0.0)
    if border_length_mm(scan) <= CLOSED_BORDER_RATIO * float(np.sqrt(scan.face_areas_mm2().sum())):
        weights = working_design.weights()
        return _off_patch(working_design, distance, weights, visible_mm, min_area_mm2)
    patch = _seen_past(surface, normal_sign, working_design, design, visible_mm)
    min_seen_past_mm2 = DIFFERENCE.min_seen_past_share * float(design.mesh.face_areas_mm2().sum())
    if patch is not None and patch.area_mm2 >= min_seen_past_mm2:
        return patch
    return _unseen_body(working_design, distance, inlier_mm, min_area_mm2)


def _seen_past(
    scan: Surface, normal_sign: float, working_design: Mesh, design: Surface, visible_mm: float
) -> Patch | None:
    """The largest patch of the design where the scanner saw a surface behind it, through its material: under
    a boss that is not there. In a corner that was not scanned there is only air between surface and scan.

    scan : in the design's frame
    """
    samples = sampling.on_surface(design.mesh, DIFFERENCE.samples, 0)
    closest = scan.closest(samples.points)
    in_front = normal_sign * np.einsum("kd,kd->k", samples.points - closest.point, closest.normal) > 0
    chosen = np.flatnonzero(in_front & (closest.distance > visible_mm) & ~scan.on_open_border(closest))
    middle = (samples.points[chosen] + closest.point[chosen]) / 2
    depth_mm = -design.signed_distance(middle, design.closest(middle))
    chosen = chosen[depth_mm > DIFFERENCE.min_depth_ratio * visible_mm]
    if chosen.size == 0:
        return None
    _, vertex = nearest(working_design.vertices, samples.points[chosen])
    count = np.bincount(vertex, minlength=len(working_design.vertices))
    summed = np.bincount(vertex, weights=closest.distance[chosen], minlength=len(count))
    mean_mm = np.divide(summed, count, out=np.zeros(len(count)), where=count > 0)
    area_of_sample_mm2 = float(design.mesh.face_areas_mm2().sum()) / DIFFERENCE.samples
    areas_mm2 = area_of_sample_mm2 * count.astype(np.float64)
    return largest_patch(working_design, mean_mm, count > 0, areas_mm2)


def _unseen_body(mesh: Mesh, distance: FloatArray, inlier_mm: float, min_area_mm2: float) -> Patch | None:
    """The largest connected piece of the design of which the scan shows nothing."""
    pieces = Pieces.of(mesh)
    if pieces.count == 1:
        return None
    areas = mesh.vertex_areas_mm2()
    seen_mm2 = np.bincount(pieces.of_vertex, weights=areas * (distance <= inlier_mm), minlength=pieces.count)
    for piece in np.argsort(-pieces.weight, kind="stable"):
        rest_mm2 = float(pieces.weight.sum() - pieces.weight[piece])
        rest_seen = float(seen_mm2.sum() - seen_mm2[piece]) / max(rest_mm2, 1e-300)
        unseen = seen_mm2[piece] <= DIFFERENCE.max_unseen_share * pieces.weight[piece]
        if pieces.weight[piece] < min_area_mm2 or not unseen or rest_seen < DIFFERENCE.min_rest_seen:
            continue
        members = np.flatnonzero(pieces.of_vertex == piece)
        farthest = members[int(distance[members].argmax())]
        mean = float(np.average(distance[members], weights=np.maximum(areas[members], 1e-300)))
        return Patch(mesh.vertices[farthest], float(pieces.weight[piece]), mean, float(distance[farthest]))
    return None


def _in_cavity(mesh: Mesh, design: Surface) -> BoolArray:
    """(n,) the vertices of pieces whose surface the design itself covers nearly everywhere."""
    pieces = Pieces.of(mesh)
    if pieces.count == 1:
        return np.zeros(len(mesh.vertices), dtype=np.bool_)
    normals = mesh.vertex_normals()
    starts = mesh.vertices + DIFFERENCE.ray_start_share * design.mesh.diagonal_mm * normals
    covered = design.intersects_rays(starts, normals)
    share = np.bincount(pieces.of_vertex, weights=covered) / np.bincount(pieces.of_vertex)
    return np.asarray((share > DIFFERENCE.hidden_share)[pieces.of_vertex])


def _signed(points: FloatArray, closest: FloatArray, normal: FloatArray, distance: FloatArray) -> FloatArray:
    """(k,) distance, negative behind the plane of the closest triangle."""
    side = np.einsum("kd,kd->k", points - closest, normal)
    return np.where(side < 0, -distance, distance)


def _on_working_mesh(
    values: FloatArray, weights: FloatArray, working_of_clean: IndexArray, count: int
) -> tuple[FloatArray, FloatArray]:
    """Weighted mean (count,) of the values of the vertices nearest to each working vertex, and their
    weight.
    """
    total = np.bincount(working_of_clean, weights=weights, minlength=count).astype(np.float64)
    summed = np.bincount(working_of_clean, weights=weights * values, minlength=count)
    return np.divide(summed, total, out=np.zeros(count), where=total > 0), total
