"""What the two surfaces say about one pose: do their normals agree, is what is left of the distances noise
and smooth distortion or a difference of shape, and where do they differ?
"""

from dataclasses import dataclass

import numpy as np

from pipeline.core.mesh import BoolArray, FloatArray, IndexArray, Mesh
from pipeline.kernels import rigid, topology
from pipeline.kernels.patches import patch_means
from pipeline.kernels.surface import Surface
from pipeline.kernels.surface_patches import Patch, without_low_order
from pipeline.verification.chord_errors import ChordErrors
from pipeline.verification.missing_material import missing_patch
from pipeline.verification.off_patch import off_patch
from pipeline.verification.placed_scan import PlacedScan
from pipeline.verification.seen_through import seen_through_patch
from pipeline.verification.thresholds import DIFFERENCE


@dataclass(frozen=True, slots=True)
class SurfaceEvidence:
    """normal_agreement : mean cosine of the angle between the normals of scan and design over the area of the
    scan; 0 counts beyond the inlier distance; detail_mm : RMS over patches of the mean signed distance,
    without what is of low order; scan_patch : the largest patch of the scan off the design, in the design's
    frame, + outside; design_patch : the largest patch of the design that the scan should show and does
    not; through_patch : the largest patch of the scan that the design's material would hide; each None where
    there is none; thickness_mm : RMS distance of the scan from its own best plane
    """

    normal_agreement: float
    detail_mm: float
    scan_patch: Patch | None
    design_patch: Patch | None
    through_patch: Patch | None
    thickness_mm: float


def assess_surfaces(
    scan: PlacedScan, design: Surface, working_design: Mesh, inlier_mm: float, accuracy_mm: float
) -> SurfaceEvidence:
    """The evidence under one pose. design : exact; working_design : its working mesh; accuracy_mm : of the
    scanner as stated (1 sigma), or 0
    """
    fit = scan.fit
    visible_mm = max(
        DIFFERENCE.min_sigmas * accuracy_mm,
        DIFFERENCE.min_residuals * fit.truncated_rms_mm,
        DIFFERENCE.min_size_share * design.mesh.diagonal_mm,
    )
    min_area_mm2 = DIFFERENCE.min_area_share * float(design.mesh.face_areas_mm2().sum())
    placed = Mesh(rigid.transformed(fit.T_design_scan, scan.working.vertices), scan.working.faces)
    closest = design.closest(placed.vertices)
    cosine = scan.normal_sign * np.einsum("kd,kd->k", placed.vertex_normals(), closest.normal)
    agrees = np.clip(cosine, 0.0, 1.0) * (closest.distance <= inlier_mm)
    signed = design.signed_distance(fit.moved, fit.closest)
    weights = scan.mesh.weights()
    signed_w, weights_w = _on_working_mesh(signed, weights, scan.working_of_clean, len(placed.vertices))
    clipped = np.clip(signed_w, -inlier_mm, inlier_mm)
    detail = without_low_order(placed.vertices, clipped, np.maximum(weights_w, 1e-12))
    share, mean = patch_means(placed.vertices, detail, weights_w)
    shown = scan.shown()
    area_mm2 = float(shown.surface.mesh.face_areas_mm2().sum())
    if scan.surface is None:  # a cloud has no triangles: its working mesh stands for it
        at, ends, share_of_area = placed.vertices, topology.edges(placed.faces).ends, weights_w
    else:
        at, ends, share_of_area = fit.moved, scan.surface.edges.ends, weights
    of_surface = (signed_w, closest.face) if scan.surface is None else (signed, fit.closest.face)
    chord_errors = ChordErrors(design, shown, *of_surface, visible_mm)

    def scan_patch(values: FloatArray) -> Patch | None:
        """values : (n,) of the vertices of the scan"""
        if scan.surface is None:
            values = _on_working_mesh(values, weights, scan.working_of_clean, len(at))[0]
        return off_patch(at, ends, area_mm2 * share_of_area, values, visible_mm, min_area_mm2, inlier_mm)

    def explained() -> BoolArray:
        """(n,) the vertices of the scan that only chords of the design lie off"""
        return chord_errors.explain_scan(fit.closest.face, signed)

    patch = scan_patch(signed)
    if patch is not None:
        patch = scan_patch(np.where(explained(), 0.0, signed))
    return SurfaceEvidence(
        normal_agreement=float(np.average(agrees, weights=np.maximum(placed.weights(), 1e-15))),
        detail_mm=float(np.sqrt((share * mean**2).sum() / max(float(share.sum()), 1e-300))),
        scan_patch=patch,
        design_patch=missing_patch(chord_errors, working_design, inlier_mm, min_area_mm2),
        through_patch=seen_through_patch(scan, design, visible_mm, explained),
        thickness_mm=_thickness_mm(fit.moved, weights),
    )


def _thickness_mm(points: FloatArray, weights: FloatArray) -> float:
    """RMS distance of points (n, 3) from their best plane."""
    centred = points - np.average(points, axis=0, weights=weights)
    covariance = np.einsum("n,ni,nj->ij", weights, centred, centred)
    return float(np.sqrt(max(0.0, np.linalg.eigvalsh(covariance)[0])))


def _on_working_mesh(
    values: FloatArray, weights: FloatArray, working_of_clean: IndexArray, count: int
) -> tuple[FloatArray, FloatArray]:
    """Weighted mean (count,) of the values of the vertices nearest to each working vertex, and their
    weight.
    """
    total = np.bincount(working_of_clean, weights=weights, minlength=count).astype(np.float64)
    summed = np.bincount(working_of_clean, weights=weights * values, minlength=count)
    return np.divide(summed, total, out=np.zeros(count), where=total > 0), total
