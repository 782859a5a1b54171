"""Chords across sharp details are no difference of shape, and the same amount of missing material is one.

The part is a ball with fissures (or crests) along two great circles, narrower than the triangles of a mesh of
it, so that two meshes of the same part lie far apart there, closed or open.
"""

import numpy as np
import pytest

from pipeline.core.mesh import FloatArray, Mesh
from pipeline.kernels.surface import Surface
from pipeline.stages.registration import evaluate_fit
from pipeline.verification.placed_scan import PlacedScan
from pipeline.verification.surface_evidence import SurfaceEvidence, assess_surfaces
from tests.support import shapes

RADIUS_MM, INLIER_MM = 20.0, 1.5
#: Across the middle of a fissure, to either side; edges are 1.3 mm long of 4 levels, 0.7 mm of 5.
HALF_WIDTH_MM = 0.8
NORMALS = np.array([[0.3, -0.5, 1.0], [1.0, 0.8, 0.1]])


def part(levels: int, height_mm: float, triangulation: int) -> Mesh:
    """The ball with crests (with fissures, where the height is negative); every `triangulation` samples the
    same surface at other points.
    """
    sphere = shapes.icosphere(1.0, levels)
    n = sphere.vertices @ shapes.motion(triangulation)[:3, :3].T
    planes = NORMALS / np.linalg.norm(NORMALS, axis=1, keepdims=True)
    from_middle_mm = RADIUS_MM * np.abs(np.einsum("nd,kd->nk", n, planes)).min(axis=1)
    share = np.clip(1.0 - from_middle_mm / HALF_WIDTH_MM, 0.0, 1.0)
    return Mesh((RADIUS_MM + height_mm * share)[:, None] * n, sphere.faces)


def opened(mesh: Mesh) -> Mesh:
    """Without its lowest fifth."""
    low = mesh.vertices[:, 2] < -0.6 * RADIUS_MM
    used = np.unique(faces := mesh.faces[~low[mesh.faces].any(axis=1)])
    return Mesh(mesh.vertices[used], np.searchsorted(used, faces))


def evidence(scan: Mesh, design: Mesh) -> SurfaceEvidence:
    """Of a scan in place, which is its own working mesh."""
    surface = Surface(design)
    fit = evaluate_fit(scan, scan.weights(), surface, np.eye(4), INLIER_MM)
    placed = PlacedScan(scan, fit, 1.0, scan, np.arange(len(scan.vertices)), Surface(scan))
    return assess_surfaces(placed, surface, design, INLIER_MM, 0.0)


def off_mm(scan: Mesh, design: Mesh) -> FloatArray:
    surface = Surface(design)
    return surface.signed_distance(scan.vertices, surface.closest(scan.vertices))


@pytest.mark.parametrize("height_mm", [-1.6, 1.6], ids=["fissures", "crests"])
@pytest.mark.parametrize(("of_design", "of_scan"), [(5, 5), (4, 5), (5, 4)])
@pytest.mark.parametrize("is_open", [False, True], ids=["closed", "open"])
def test_chords_across_fissures_and_crests_are_no_difference(
    height_mm: float, of_design: int, of_scan: int, is_open: bool
) -> None:
    design, scan = part(of_design, height_mm, 1), part(of_scan, height_mm, 2)
    scan = opened(scan) if is_open else scan
    assert np.abs(off_mm(scan, design)).max() > 0.6 or np.abs(off_mm(design, scan)).max() > 0.6
    found = evidence(scan, design)
    assert (found.scan_patch, found.design_patch, found.through_patch) == (None, None, None)


#: A coarse design leaves a larger residual, and what can be seen beside it is larger.
@pytest.mark.parametrize(("of_design", "of_scan", "depth_mm"), [(5, 5, 1.6), (5, 4, 1.6), (4, 5, 2.4)])
@pytest.mark.parametrize("sign", [-1, 1], ids=["missing", "excess"])
@pytest.mark.parametrize("is_open", [False, True], ids=["closed", "open"])
@pytest.mark.parametrize("direction", [(0.2, 0.4, 0.9), tuple(np.cross(*NORMALS))], ids=["face", "crossing"])
def test_material_as_deep_as_a_fissure_that_is_missing_or_too_much_is_found(
    of_design: int, of_scan: int, depth_mm: float, sign: int, is_open: bool, direction: tuple[float, ...]
) -> None:
    design, scan = part(of_design, -1.6, 1), part(of_scan, -1.6, 2)
    n = scan.vertices / np.linalg.norm(scan.vertices, axis=1, keepdims=True)
    towards = np.array(direction) / np.linalg.norm(direction) * np.sign(direction[2])
    changed = n @ towards > np.cos(3.0 / RADIUS_MM)
    scan = Mesh(scan.vertices + sign * depth_mm * changed[:, None] * n, scan.faces)
    patch = evidence(opened(scan) if is_open else scan, design).scan_patch
    assert patch is not None and np.sign(patch.mean) == sign
    assert np.linalg.norm(patch.centre_mm - RADIUS_MM * towards) < 6.0


def test_a_flat_face_of_the_design_is_exact_where_no_corner_of_it_is_near() -> None:
    box = shapes.box((40.0, 30.0, 10.0))  # two triangles a face
    scan = shapes.box((40.0, 30.0, 10.0), 5)
    x, y, z = scan.vertices.T
    hollow = (np.hypot(x - 20.0, y - 15.0) < 3.0) & (z > 9.9)
    dented = Mesh(scan.vertices - np.outer(0.8 * hollow, [0.0, 0.0, 1.0]), scan.faces)
    assert evidence(scan, box).scan_patch is None
    patch = evidence(dented, box).scan_patch
    assert patch is not None and patch.peak < -0.5
