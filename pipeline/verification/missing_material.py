"""What of the design the scan should show, and does not."""

import numpy as np

from pipeline.core.mesh import BoolArray, FloatArray, Mesh
from pipeline.kernels import remesh, sampling, topology
from pipeline.kernels.nearest import nearest
from pipeline.kernels.pieces import Pieces
from pipeline.kernels.surface import Surface
from pipeline.kernels.surface_patches import Patch, adjacency_of, border_length_mm, largest_patch
from pipeline.verification.chord_errors import ChordErrors
from pipeline.verification.off_patch import off_patch
from pipeline.verification.thresholds import DIFFERENCE

#: A scan with less open border than this many square roots of its area is closed. Chosen by hand.
CLOSED_BORDER_RATIO = 0.3


def missing_patch(
    surfaces: ChordErrors, working_design: Mesh, inlier_mm: float, min_area_mm2: float
) -> Patch | None:
    """The largest patch of the design that the scan should show and does not, in the design's frame.

    Of a closed scan any patch that lies off it. An open one leaves out what the scanner did not see: there,
    what the scanner saw past (`_seen_past`); and a whole body, where the scan shows most of the others.
    Cavities, which no scanner of surfaces sees, do not count; nor does what lies off chords only.
    """
    scan, design, visible_mm = surfaces.scan, surfaces.design, surfaces.visible_mm
    coarse_mm = max(visible_mm, DIFFERENCE.min_coarse_share * design.mesh.diagonal_mm)
    if scan.is_reconstructed:  # its sharp edges are cut by up to the length of an edge
        visible_mm = coarse_mm = max(coarse_mm, remesh.edge_mm(scan.surface.mesh, 0.5))
    visible = ~_in_cavity(working_design, design)
    # A coarse working mesh leaves the design where that is fine; the scan need not follow it there.
    on_design = design.closest(working_design.vertices)
    closest = scan.closest(on_design.point)
    distance = np.where(visible, closest.distance, 0.0)
    mesh = scan.surface.mesh
    border_mm = border_length_mm(mesh.vertices, scan.surface.edges)
    if border_mm <= CLOSED_BORDER_RATIO * float(np.sqrt(mesh.face_areas_mm2().sum())):
        areas_mm2, ends = working_design.vertex_areas_mm2(), topology.edges(working_design.faces).ends

        def patch_of(distances_mm: FloatArray) -> Patch | None:
            on = (on_design.point, ends, areas_mm2, distances_mm)
            return off_patch(*on, coarse_mm, min_area_mm2, inlier_mm)

        if patch_of(distance) is None:
            return None
        explained = surfaces.explain_design(on_design.point, on_design.face, closest)
        return patch_of(np.where(explained, 0.0, distance))
    patch = _seen_past(surfaces, working_design, visible_mm)
    min_seen_past_mm2 = DIFFERENCE.min_seen_past_share * float(design.mesh.face_areas_mm2().sum())
    if patch is not None and patch.area_mm2 >= min_seen_past_mm2:
        return patch
    return _unseen_body(working_design, distance, inlier_mm, min_area_mm2)


def _seen_past(surfaces: ChordErrors, working_design: Mesh, visible_mm: float) -> Patch | None:
    """The largest patch of the design where the scanner saw a surface behind it, through its material: under
    a boss that is not there. In a corner that was not scanned there is only air between surface and scan.

    The closest place of the scan lies in the design's material there. Below a surface that is there, and was
    not scanned, it lies on the design.
    """
    scan, design = surfaces.scan, surfaces.design
    samples = sampling.on_surface(design.mesh, DIFFERENCE.samples, 0)
    closest = scan.closest(samples.points)
    in_front = np.einsum("kd,kd->k", samples.points - closest.point, closest.normal) > 0
    chosen = np.flatnonzero(
        in_front & (closest.distance > visible_mm) & ~scan.surface.on_open_border(closest)
    )
    end, within = closest.point[chosen], np.ones(len(chosen), dtype=np.bool_)
    for point in (end, (samples.points[chosen] + end) / 2):
        depth_mm = -design.signed_distance(point, design.closest(point))
        within &= depth_mm > DIFFERENCE.min_depth_ratio * visible_mm
    chosen = chosen[within]
    if chosen.size == 0:
        return None
    points, face = samples.points[chosen], samples.face[chosen]
    chosen = chosen[~surfaces.explain_design(points, face, closest.of(chosen))]
    if chosen.size == 0:
        return None
    _, vertex = nearest(working_design.vertices, samples.points[chosen])
    count = np.bincount(vertex, minlength=len(working_design.vertices))
    summed = np.bincount(vertex, weights=closest.distance[chosen], minlength=len(count))
    mean_mm = np.divide(summed, count, out=np.zeros(len(count)), where=count > 0)
    area_of_sample_mm2 = float(design.mesh.face_areas_mm2().sum()) / DIFFERENCE.samples
    areas_mm2 = area_of_sample_mm2 * count.astype(np.float64)
    near = adjacency_of(working_design)
    return largest_patch(working_design.vertices, near, areas_mm2, mean_mm, count > 0)


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
