"""The demo's arch is a dental arch, its print is a print of it, and the known truth is true."""

from functools import cache

import numpy as np
import open3d
import pytest
import trimesh
from scipy.spatial import cKDTree

from service.demo import arch as demo_arch
from service.demo import crowns as demo_crowns
from service.demo.arch import Printed, Surface
from service.demo.crowns import KINDS, Kind

CUSPS = {
    "central incisor": 1,  # its edge: nearly level, one highest point
    "lateral incisor": 1,
    "canine": 1,
    "first premolar": 2,
    "second premolar": 2,
    "first molar": 5,
    "second molar": 4,
}


@pytest.fixture(scope="module")
def design() -> Surface:
    return demo_arch.arch()


@cache
def print_of(seed: int) -> Printed:
    return demo_arch.printed(seed=seed)


@pytest.fixture(scope="module")
def printed() -> Printed:
    return print_of(0)


def as_trimesh(surface: Surface) -> trimesh.Trimesh:
    return trimesh.Trimesh(surface.vertices, surface.faces, process=False)


def distances_mm(surface: Surface, points: np.ndarray) -> np.ndarray:
    """(n,) from each point to the surface."""
    scene = open3d.t.geometry.RaycastingScene(nthreads=1)
    scene.add_triangles(surface.vertices.astype(np.float32), surface.faces.astype(np.uint32))
    return scene.compute_distance(points.astype(np.float32)).numpy()


def count_maxima(kind: Kind) -> int:
    """Highest points of the biting surface among their eight neighbours, on a grid of 0.1 mm."""
    u, v = np.meshgrid(
        np.arange(-0.48 * kind.width, 0.48 * kind.width, 0.1),
        np.arange(-0.46 * kind.depth, 0.46 * kind.depth, 0.1),
        indexing="ij",
    )
    height = demo_crowns.occlusal(kind, u, v)
    middle = height[1:-1, 1:-1]
    highest = np.ones(middle.shape, dtype=bool)
    for i in (0, 1, 2):
        for j in (0, 1, 2):
            if (i, j) != (1, 1):
                rows, columns = middle.shape
                highest &= middle > height[i : i + rows, j : j + columns]
    return int(highest.sum())


@pytest.mark.parametrize("kind", sorted(set(KINDS), key=lambda kind: kind.name), ids=lambda kind: kind.name)
def test_each_kind_of_crown_has_its_cusps(kind):
    assert count_maxima(kind) == CUSPS[kind.name]


def test_a_canine_is_pointed_where_an_incisor_has_an_edge():
    def fall_mm(kind: Kind) -> float:
        """From the highest point, three quarters of the way to the side."""
        v = kind.cusps[0][1] * kind.depth / 2
        u = np.array([kind.cusps[0][0] * kind.width / 2, 0.75 * kind.width / 2])
        middle, side = demo_crowns.occlusal(kind, u, np.full(2, v))
        return float(middle - side)

    assert fall_mm(demo_crowns.CENTRAL) < 0.6
    assert fall_mm(demo_crowns.LATERAL) < 0.6
    assert fall_mm(demo_crowns.CANINE) > 1.5


def test_the_arch_has_fourteen_teeth_of_four_kinds():
    assert len(KINDS) == 14
    assert {kind.name.split()[-1] for kind in KINDS} == {"incisor", "canine", "premolar", "molar"}


def test_the_arch_has_the_size_of_a_dental_arch(design):
    assert abs(len(design.vertices) - 5000) < 150
    width, depth, height = np.ptp(design.vertices, axis=0)
    assert 60 < width < 67
    assert 45 < depth < 60
    assert 10 < height < 18


@pytest.mark.parametrize("n_vertices", [2000, 8000])
def test_the_number_of_vertices_can_be_asked_for(n_vertices):
    assert len(demo_arch.arch(n_vertices).vertices) == pytest.approx(n_vertices, rel=0.03)


@pytest.mark.parametrize("which", ["design", "print"])
def test_the_surface_is_one_sheet_with_one_border(which, design, printed):
    surface = design if which == "design" else printed.scan
    mesh = as_trimesh(surface)
    assert mesh.is_winding_consistent
    assert mesh.body_count == 1
    assert mesh.euler_number == 1  # a disc: one sheet, one border loop, no holes, no handles
    assert len(np.unique(surface.faces)) == len(surface.vertices)
    edges, uses = np.unique(np.sort(mesh.edges, axis=1), axis=0, return_counts=True)
    assert uses.max() == 2
    assert len(trimesh.graph.connected_components(edges[uses == 1])) == 1


@pytest.mark.parametrize("which", ["design", "print"])
def test_no_triangle_is_degenerate(which, design, printed):
    surface = design if which == "design" else printed.scan
    corners = surface.vertices[surface.faces]
    sides_sq = ((corners - np.roll(corners, 1, axis=1)) ** 2).sum(axis=(1, 2))
    areas = as_trimesh(surface).area_faces
    quality = 4 * np.sqrt(3) * areas / sides_sq  # 1 for an equilateral triangle
    assert quality.min() > 0.01
    assert np.median(quality) > 0.8
    assert np.quantile(np.sqrt(sides_sq), 0.99) < 5.0


def test_the_outside_is_up(design):
    normals = as_trimesh(design).face_normals
    top = design.vertices[design.faces].mean(axis=1)[:, 2] > 6.0
    assert normals[top, 2].mean() > 0.3


def test_the_arch_is_not_its_own_mirror_image(design):
    mirrored = design.vertices * [-1.0, 1.0, 1.0]
    off_mm = distances_mm(design, mirrored)
    assert np.sqrt((off_mm**2).mean()) > 0.15


def test_the_same_seed_gives_the_same_bytes(design, printed):
    again, reprinted = demo_arch.arch(), demo_arch.printed()
    assert again.vertices.tobytes() == design.vertices.tobytes()
    assert again.faces.tobytes() == design.faces.tobytes()
    assert reprinted.scan.vertices.tobytes() == printed.scan.vertices.tobytes()
    assert reprinted.T_design_scan.tobytes() == printed.T_design_scan.tobytes()


def test_another_seed_gives_another_arch_and_pose(design, printed):
    off_mm = distances_mm(design, demo_arch.arch(seed=1).vertices)
    assert np.sqrt((off_mm**2).mean()) > 0.1
    assert not np.allclose(print_of(1).T_design_scan, printed.T_design_scan, atol=0.05)


def test_the_truth_is_a_rigid_motion_within_bounds(printed):
    T = printed.T_design_scan
    assert np.allclose(T[:3, :3].T @ T[:3, :3], np.eye(3), atol=1e-12)
    assert np.linalg.det(T[:3, :3]) == pytest.approx(1.0)
    T_scan_design = np.linalg.inv(T)
    assert np.linalg.norm(T_scan_design[:3, 3]) < demo_arch.POSE_MM


@pytest.mark.parametrize("seed", [0, 1, 2])
def test_the_truth_puts_the_print_back_within_shrink_warp_and_noise(seed):
    printed = print_of(seed)
    T = printed.T_design_scan
    on_design = printed.scan.vertices @ T[:3, :3].T + T[:3, 3]
    fine = demo_arch.arch(12000, seed)  # the chords of 5000 vertices are farther off the formula
    off_mm = distances_mm(fine, on_design)
    reach_mm = np.linalg.norm(fine.vertices - fine.vertices.mean(axis=0), axis=1).max()
    bound_mm = demo_arch.SHRINK * reach_mm + 2 * demo_arch.WARP_MM + 5 * demo_arch.NOISE_MM
    assert np.quantile(off_mm, 0.99) < bound_mm
    assert np.sqrt((off_mm**2).mean()) < bound_mm / 2
    assert np.sqrt((off_mm**2).mean()) > demo_arch.NOISE_MM  # it is not a mere copy


def test_the_print_is_triangulated_anew(design, printed):
    T = printed.T_design_scan
    on_design = printed.scan.vertices @ T[:3, :3].T + T[:3, 3]
    apart_mm = cKDTree(design.vertices).query(on_design)[0]
    assert abs(len(printed.scan.vertices) - len(design.vertices)) > 500
    assert np.median(apart_mm) > 0.3  # about a third of an edge: as far as vertices strewn at random
    degree = np.bincount(printed.scan.faces.ravel())
    assert len(np.unique(degree)) > 3  # an irregular triangulation
