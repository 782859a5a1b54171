"""What the surfaces say: a bump and a dent are found where they are, a body that is not scanned too, a cavity
is none, and smooth distortion is no difference of shape.
"""

from dataclasses import replace
from functools import cache

import numpy as np

from pipeline.core.mesh import FloatArray, Mesh
from pipeline.core.stations import Stations
from pipeline.kernels import rigid
from pipeline.kernels.nearest import nearest
from pipeline.kernels.surface import Surface
from pipeline.kernels.surface_patches import Patch
from pipeline.stages.registration import evaluate_fit
from pipeline.verification.placed_scan import PlacedScan
from pipeline.verification.surface_evidence import SurfaceEvidence, assess_surfaces
from tests.support import shapes
from tests.support.scanners.rays import seen_from
from tests.support.scanners.structured_light import retriangulated
from tests.support.scanners.surroundings import joined
from tests.support.variants.cover import Cover

BLOB = shapes.bumpy_blob(4)
INLIER_MM = 1.3
NOISE_MM = 0.02
BALL = shapes.icosphere(4.0, 3)


def evidence(scan: Mesh, design: Mesh = BLOB) -> SurfaceEvidence:
    """Of a scan in place, which is its own working mesh."""
    surface = Surface(design)
    fit = evaluate_fit(scan, scan.weights(), surface, np.eye(4), INLIER_MM)
    of_clean = np.arange(len(scan.vertices))
    placed = PlacedScan(scan, fit, 1.0, scan, of_clean, Surface(scan))
    return assess_surfaces(placed, surface, design, INLIER_MM, NOISE_MM)


def raised(height_mm: float, direction: FloatArray, width_deg: float = 14.0) -> Mesh:
    """The blob with a bump (a dent) of that height around one direction."""
    n = BLOB.vertices / np.linalg.norm(BLOB.vertices, axis=1, keepdims=True)
    inside = n @ direction > np.cos(np.radians(width_deg))
    return Mesh(BLOB.vertices + height_mm * inside[:, None] * BLOB.vertex_normals(), BLOB.faces)


def test_the_part_itself_differs_nowhere() -> None:
    found = evidence(BLOB)
    assert found.normal_agreement > 0.98
    assert found.detail_mm < 1e-6
    assert found.scan_patch is None and found.design_patch is None


def test_where_a_coarse_working_mesh_leaves_the_design_nothing_is_missing() -> None:
    """As between parts that stand closer to each other than its edges are long."""
    surface, of_clean = Surface(BLOB), np.arange(len(BLOB.vertices))
    working = raised(-1.5, np.array([0.0, 0.6, 0.8]))
    for scan, is_missing in ((BLOB, False), (working, True)):
        fit = evaluate_fit(scan, scan.weights(), surface, np.eye(4), INLIER_MM)
        placed = PlacedScan(scan, fit, 1.0, scan, of_clean, Surface(scan))
        found = assess_surfaces(placed, surface, working, INLIER_MM, NOISE_MM).design_patch
        assert (found is not None) == is_missing


def test_a_bump_and_a_dent_are_found_where_they_are_with_their_side() -> None:
    direction = np.array([0.0, 0.6, 0.8])
    for height_mm in (1.5, -1.5):
        patch = evidence(raised(height_mm, direction)).scan_patch
        assert patch is not None
        assert np.sign(patch.mean) == np.sign(height_mm)
        assert 0.5 < abs(patch.peak) <= 1.6
        at = patch.centre_mm / np.linalg.norm(patch.centre_mm)
        assert at @ direction > np.cos(np.radians(20))


def test_smooth_distortion_and_noise_are_no_difference() -> None:
    rng = np.random.default_rng(0)
    x, y, _ = (BLOB.vertices / 30.0).T
    bent = 0.4 * (x**2 - 0.5 * x * y)
    noise = rng.normal(0.0, NOISE_MM, len(x))
    found = evidence(Mesh(BLOB.vertices + (bent + noise)[:, None] * BLOB.vertex_normals(), BLOB.faces))
    assert found.scan_patch is None and found.design_patch is None
    assert found.detail_mm < 0.05


def opened(mesh: Mesh) -> Mesh:
    """Without what lies lowest: a scan on a table."""
    low = mesh.vertices[:, 2] < np.quantile(mesh.vertices[:, 2], 0.1)
    used = np.unique(faces := mesh.faces[~low[mesh.faces].any(axis=1)])
    return Mesh(mesh.vertices[used], np.searchsorted(used, faces))


def test_a_body_that_is_not_scanned_is_missing_and_a_cavity_is_not() -> None:
    body = Mesh(BALL.vertices + np.array([34.0, 0.0, 0.0]), BALL.faces)
    for scan in (BLOB, opened(BLOB)):
        patch = evidence(scan, joined([BLOB, body])).design_patch
        assert patch is not None
        assert np.linalg.norm(patch.centre_mm - [34.0, 0.0, 0.0]) < 4.5
    cavity = Mesh(BALL.vertices, BALL.faces[:, ::-1])
    for scan in (BLOB, opened(BLOB)):
        assert evidence(scan, joined([BLOB, cavity])).design_patch is None


def test_what_an_open_scan_does_not_show_is_not_missing() -> None:
    found = evidence(opened(BLOB))
    assert found.scan_patch is None and found.design_patch is None


def test_the_round_edges_of_a_surface_made_from_points_are_no_missing_material() -> None:
    box = shapes.box((30.0, 20.0, 12.0))
    for _ in range(4):
        box = shapes.subdivided(box)
    on_edge = np.abs(box.vertices - box.vertices.min(axis=0))[:, 1:].max(axis=1) < 1e-9  # the edge along x
    inward = np.array([0.0, 0.5, 0.5])
    blunt = Mesh(box.vertices + on_edge[:, None] * inward, box.faces)
    surface, cloud = Surface(box), Mesh(box.vertices, np.zeros((0, 3), dtype=np.int32))
    fit = evaluate_fit(cloud, cloud.weights(), surface, np.eye(4), INLIER_MM)
    placed = PlacedScan(cloud, fit, 1.0, blunt, np.arange(len(box.vertices)), None)
    assert assess_surfaces(placed, surface, box, INLIER_MM, 0.0).design_patch is None


def cover_part(change: str | None) -> Mesh:
    """The cover, or its version with that change."""
    cover = Cover.sampled(3)
    return cover.mesh() if change is None else cover.changes()[change].mesh()


@cache
def cover_design() -> Mesh:
    return retriangulated(cover_part(None), 8_000)


@cache
def cover_scanned(change: str | None) -> Mesh:
    """With other triangles, and noise."""
    even = retriangulated(cover_part(change), 8_000)
    noise = np.random.default_rng(1).normal(0.0, NOISE_MM, len(even.vertices))
    return Mesh(even.vertices + noise[:, None] * even.vertex_normals(), even.faces)


def test_a_floor_that_a_thin_rib_would_hide_shows_that_the_rib_is_missing() -> None:
    assert evidence(cover_scanned(None), cover_design()).through_patch is None
    patch = evidence(cover_scanned("rib missing"), cover_design()).through_patch
    assert patch is not None and patch.peak > 4 * NOISE_MM
    off_mm = Surface(cover_part("rib missing")).closest(patch.centre_mm[None]).distance[0]
    assert off_mm < 4 * NOISE_MM  # on the floor


def from_two_sides(scan: Mesh, design: Surface, T_design_scan: FloatArray) -> tuple[PlacedScan, PlacedScan]:
    """The vertices of a mesh as points, without and with the stations that saw them, in the scan frame."""
    middle, reach = scan.vertices.mean(axis=0), 5 * scan.diagonal_mm
    directions = np.array([[0.6, 0.0, 0.8], [-0.36, 0.48, -0.8]])
    seen = [seen_from(scan, scan.vertices, scan.vertex_normals(), each) for each in directions]
    points = Mesh(np.concatenate([scan.vertices[each] for each in seen])).moved(rigid.inverse(T_design_scan))
    working = scan.moved(rigid.inverse(T_design_scan))
    positions = rigid.transformed(rigid.inverse(T_design_scan), middle + reach * directions)
    of_vertex = np.repeat(np.arange(2, dtype=np.int32), [each.sum() for each in seen])
    _, of_clean = nearest(working.vertices, points.vertices)
    fit = evaluate_fit(points, points.weights(), design, T_design_scan, INLIER_MM)
    without = PlacedScan(points, fit, 1.0, working, of_clean, None)
    return without, replace(without, stations=Stations(positions, of_vertex))


def test_of_points_the_way_to_the_scanner_shows_that_a_rib_is_missing() -> None:
    design, T = Surface(cover_design()), shapes.motion(2)

    def through(placed: PlacedScan) -> Patch | None:
        return assess_surfaces(placed, design, design.mesh, INLIER_MM, NOISE_MM).through_patch

    _, right = from_two_sides(cover_scanned(None), design, T)
    assert through(right) is None
    unknown, known = from_two_sides(cover_scanned("rib missing"), design, T)
    assert through(unknown) is None  # points have no outer side
    patch = through(known)
    assert patch is not None and patch.peak > 4 * NOISE_MM
    assert Surface(cover_part("rib missing")).closest(patch.centre_mm[None]).distance[0] < 4 * NOISE_MM


def test_a_wall_across_a_narrow_gap_hides_nothing() -> None:
    block = retriangulated(shapes.box((30.0, 20.0, 12.0)), 4_000)
    pair = joined([block, Mesh(block.vertices + np.array([0.0, 0.0, 12.2]), block.faces)])
    rng = np.random.default_rng(1)
    noise = rng.normal(0.0, NOISE_MM, len(pair.vertices))
    scan = Mesh(pair.vertices + noise[:, None] * pair.vertex_normals(), pair.faces)
    assert evidence(scan, pair).through_patch is None
