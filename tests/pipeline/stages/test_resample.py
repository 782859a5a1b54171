"""The working mesh is the same surface, evenly triangulated, whatever came in."""

import numpy as np
import pytest

from pipeline.core.errors import ResampleFailed
from pipeline.core.mesh import Mesh
from pipeline.core.settings import ResampleSettings
from pipeline.kernels import remesh, topology
from pipeline.kernels.surface import Surface
from pipeline.stages.resample import nearest_vertices, resample, surface_of_cloud, working_edge_mm
from tests.support import shapes

SETTINGS = ResampleSettings(target_vertices=1500)


def worked(mesh: Mesh) -> Mesh:
    edge_mm = working_edge_mm(float(mesh.face_areas_mm2().sum()), SETTINGS.target_vertices)
    return resample(mesh, "design", edge_mm, SETTINGS).mesh


@pytest.mark.parametrize("levels", [0, 6], ids=["12 triangles", "49152 triangles"])
def test_a_box_keeps_its_surface_and_gets_the_wanted_vertices(levels: int) -> None:
    box = shapes.box((10.0, 6.0, 4.0), levels)
    working = worked(box)
    assert 0.7 < len(working.vertices) / SETTINGS.target_vertices < 1.4
    assert Surface(box).closest(working.vertices).distance.max() < 0.02
    assert working.face_areas_mm2().sum() == pytest.approx(box.face_areas_mm2().sum(), rel=0.02)
    assert (topology.edges(working.faces).count == 2).all()


def test_edges_are_nearly_equal() -> None:
    working = worked(shapes.bumpy_blob(4))
    ends = topology.edges(working.faces).ends
    lengths = np.linalg.norm(working.vertices[ends[:, 0]] - working.vertices[ends[:, 1]], axis=1)
    low, high = np.percentile(lengths, [2, 98])
    assert high / low < 2.5


def test_same_input_same_bits() -> None:
    blob = shapes.bumpy_blob(4)
    assert worked(blob).vertices.tobytes() == worked(blob).vertices.tobytes()


def test_scan_points_are_meshed_near_the_points() -> None:
    blob = shapes.bumpy_blob(5)
    points = blob.vertices[blob.vertices[:, 2] > -3]  # one side seen
    found = resample(Mesh(points), "scan", 1.5, SETTINGS)
    assert Surface(blob).closest(found.mesh.vertices).distance.max() < 1.0
    area_seen = blob.face_areas_mm2()[(blob.vertices[blob.faces][:, :, 2] > -3).all(axis=1)].sum()
    assert found.mesh.face_areas_mm2().sum() == pytest.approx(area_seen, rel=0.1)
    assert len(found.working_of_clean) == len(points)


def test_disabled_is_the_mesh_itself() -> None:
    blob = shapes.bumpy_blob(2)
    found = resample(blob, "design", 1.0, ResampleSettings(enabled=False))
    assert found.mesh is blob
    np.testing.assert_array_equal(found.working_of_clean, np.arange(len(blob.vertices)))


def test_values_are_carried_from_the_nearest_surface_point() -> None:
    box = shapes.box((10.0, 10.0, 0.5), 4)
    above = np.array([[5.0, 5.0, 0.7]])
    found = nearest_vertices(box, above)
    assert box.vertices[found[0], 2] == 0.5  # the near side of a thin wall


def with_noise(mesh: Mesh, share: float) -> Mesh:
    """Every vertex moved along its normal, Gaussian, by `share` of the diagonal (one sigma)."""
    size_mm = share * mesh.diagonal_mm
    noise_mm = np.random.default_rng(0).normal(0.0, size_mm, (len(mesh.vertices), 1))
    return Mesh(mesh.vertices + noise_mm * mesh.vertex_normals(), mesh.faces)


@pytest.mark.parametrize("share", [0.0, 0.001, 0.003, 0.005])
@pytest.mark.parametrize(
    "shape",
    [
        "blob 5k",
        "box 49k",
        *(pytest.param(f"blob {size}", marks=pytest.mark.nightly) for size in ("82k", "328k")),
    ],
)
def test_edges_are_as_long_as_asked_for_however_noisy_the_scan(shape: str, share: float) -> None:
    """Noise as large as the triangles looks like creases, which remeshing keeps."""
    made = {"blob 5k": 4, "blob 82k": 6, "blob 328k": 7}
    clean = shapes.box((30.0, 20.0, 10.0), 6) if shape == "box 49k" else shapes.bumpy_blob(made[shape])
    edge_mm = working_edge_mm(float(clean.face_areas_mm2().sum()), SETTINGS.target_vertices)
    found = resample(with_noise(clean, share), "scan", edge_mm, SETTINGS, fine_edge_mm=edge_mm / 1.4)
    assert found.fine is not None and found.edge_mm == edge_mm
    assert remesh.edge_mm(found.mesh, 0.5) == pytest.approx(edge_mm, rel=0.2)
    assert remesh.edge_mm(found.fine, 0.5) == pytest.approx(edge_mm / 1.4, rel=0.2)
    off_mm = Surface(clean).closest(found.mesh.vertices).distance
    assert np.sqrt((off_mm**2).mean()) < 0.7 * share * clean.diagonal_mm + 0.05 * edge_mm


@pytest.mark.parametrize("levels", [1, 4, 6])
def test_creases_and_bumps_are_no_noise(levels: int) -> None:
    assert not remesh.is_noisy(shapes.box((30.0, 20.0, 10.0), levels))
    assert not remesh.is_noisy(shapes.bumpy_blob(min(levels, 5)))
    assert not remesh.is_noisy(shapes.gear(12))


def test_white_noise_puts_neighbours_on_opposite_sides() -> None:
    """On a regular mesh of six neighbours, two of them shared: (-2/6 + 2/36) / (1 + 1/6)."""
    plane = shapes.grid_plane(80, 80)
    noise_mm = np.random.default_rng(1).normal(0.0, 0.01, len(plane.vertices))
    noisy = Mesh(plane.vertices + noise_mm[:, None] * [0.0, 0.0, 1.0], plane.faces)
    assert remesh.neighbour_correlation(noisy) == pytest.approx(-5 / 21, abs=0.03)
    assert remesh.neighbour_correlation(plane) == 0.0


def test_a_cloud_in_another_unit_than_the_design_is_told_to_set_its_unit() -> None:
    """A scan in metres that is read as mm is smaller than one edge of the analysis."""
    points = shapes.icosphere(0.02, 4).vertices
    with pytest.raises(ResampleFailed, match=r"extend over \(0\.04, 0\.04, 0\.04\) mm") as refused:
        surface_of_cloud(points, "scan", 1.4)
    assert "options.units" in refused.value.remedy
