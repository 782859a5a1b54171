"""A uniform strain is measured in any frame, and what a surface does not determine is no strain."""

import numpy as np
import pytest

from pipeline.core.mesh import FloatArray, Mesh
from pipeline.kernels import rigid, sampling
from pipeline.kernels.strain import Strain, estimate_strain
from pipeline.kernels.surface import Surface
from tests.support import shapes

BLOB = shapes.bumpy_blob(4)
OBLIQUE = np.array([2.0, -1.0, 2.0]) / 3.0


def strained(mesh: Mesh, along: FloatArray, share: float, everywhere: float = 0.0) -> Mesh:
    """Longer by `share` along the unit vector `along`, and by `everywhere` along all."""
    F = (1.0 + everywhere) * np.eye(3) + share * np.outer(along, along)
    return Mesh(np.einsum("ij,kj->ki", F, mesh.vertices), mesh.faces)


def strain_of(scan: Mesh, design: Mesh, T_design_scan: FloatArray) -> Strain:
    points = sampling.on_surface(scan, 3000, 0).points
    found = estimate_strain(points, np.full(len(points), 1 / 3000), Surface(design), T_design_scan, 2.0)
    assert found is not None
    return found


@pytest.mark.parametrize("seed", [None, 5])
@pytest.mark.parametrize("share", [0.03, -0.03])
def test_a_stretch_is_measured_with_its_direction_in_any_frame(share: float, seed: int | None) -> None:
    R = np.eye(4) if seed is None else shapes.motion(seed)
    design, scan = BLOB.moved(R), strained(BLOB, OBLIQUE, share).moved(R)
    nearly = rigid.from_vector(np.array([[0.004, -0.003, 0.002, 0.1, -0.1, 0.1]]))[0]
    found = strain_of(scan, design, R @ nearly @ rigid.inverse(R))
    assert found.spread == pytest.approx(abs(share), rel=0.06)
    assert found.mean == pytest.approx(share / 3, rel=0.1)
    axis = found.axes[:, 2 if share > 0 else 0]
    assert abs(axis @ R[:3, :3] @ OBLIQUE) > np.cos(np.radians(5))
    assert found.shape_mm > 10 * found.left_mm


def test_another_size_has_no_direction() -> None:
    found = strain_of(strained(BLOB, OBLIQUE, 0.0, 0.03), BLOB, np.eye(4))
    assert found.mean == pytest.approx(0.03, rel=0.05) and found.spread < 0.002
    assert found.size_mm > 10 * found.left_mm and found.shape_mm < 0.1 * found.size_mm


def test_bending_leaves_more_than_a_strain_explains() -> None:
    x, y, _ = (BLOB.vertices / 20.0).T
    bent = Mesh(BLOB.vertices + np.outer(0.5 * np.sin(3 * x + 2 * y), [0.0, 0.0, 1.0]), BLOB.faces)
    found = strain_of(bent, BLOB, np.eye(4))
    assert found.shape_mm < 3 * found.left_mm


def test_a_plane_and_a_sphere_do_not_show_what_they_do_not_have() -> None:
    plane = shapes.grid_plane(41, 31)
    found = strain_of(plane, plane, np.eye(4))
    assert np.abs(found.principal).max() < 1e-9  # nothing moves off a plane
    sphere = shapes.icosphere(20.0, 4)
    found = strain_of(strained(sphere, OBLIQUE, 0.0, 0.03), sphere, np.eye(4))
    assert found.mean == pytest.approx(0.03, rel=0.05) and found.spread < 0.001


def test_too_few_points_within_reach_are_no_strain() -> None:
    far = BLOB.vertices + np.array([200.0, 0.0, 0.0])
    weights = np.full(len(far), 1 / len(far))
    assert estimate_strain(far, weights, Surface(BLOB), np.eye(4), 2.0) is None
