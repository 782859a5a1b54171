"""A table in one piece with the part is left out; a flat part stays whole, in another unit too."""

import importlib
from pathlib import Path

import numpy as np
import pytest

from pipeline.core.mesh import Mesh
from pipeline.core.settings import CleanSettings
from pipeline.kernels import rigid
from pipeline.kernels.flat_patch import largest_flat_patch
from pipeline.kernels.surface import Surface
from pipeline.stages.clean import Cleaned, clean
from pipeline.stages.table import without_table
from tests.support import shapes
from tests.support.registering import register
from tests.support.scanners.record import SimulatedScan
from tests.support.scanners.surroundings import joined
from tests.support.scans import save
from tests.support.settings import COARSE
from tests.support.variants import catalogue

depth_camera = importlib.import_module("tests.support.scanners.depth_camera")
BRACKET = catalogue.FAMILIES["bracket"](3).mesh()


def cleaned(mesh: Mesh) -> Cleaned:
    return clean(mesh, "scan", CleanSettings())


def on_table(part: Mesh, accuracy_share: float, seed: int, monkeypatch: pytest.MonkeyPatch) -> SimulatedScan:
    """One view, from above, of the part that stands on a table: one mesh from edge to edge."""
    steps, size_mm = 50, 1.8 * part.diagonal_mm
    grid = shapes.grid_plane(steps, steps, step_mm=size_mm / steps)
    low = np.append(part.vertices.mean(axis=0)[:2], part.vertices[:, 2].min())
    table = Mesh(grid.vertices - grid.vertices.mean(axis=0) + low, grid.faces)
    rng = np.random.default_rng(seed)
    above = np.append(0.7 * rng.normal(size=2), 1.5)
    monkeypatch.setattr(depth_camera, "random_direction", lambda rng: above / np.linalg.norm(above))
    monkeypatch.setattr(depth_camera, "PIXELS", 300)
    camera = depth_camera.Camera(accuracy_share * part.diagonal_mm)
    scan: SimulatedScan = depth_camera.depth_camera(joined([part, table]), camera, rng)
    return scan


@pytest.mark.parametrize("accuracy_share", [0.001, 0.01])
def test_a_table_that_the_part_stands_on_is_left_out(
    accuracy_share: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    scan = on_table(BRACKET, accuracy_share, 1, monkeypatch)
    rest, strays = without_table(cleaned(scan.mesh), BRACKET, 0)
    (note,) = strays.notes("scan")
    assert note.code == "stray_component" and "table" in note.detail
    placed = rigid.transformed(scan.T_design_scan, rest.mesh.vertices)
    off = Surface(BRACKET).closest(placed).distance / BRACKET.diagonal_mm
    assert np.mean(off < 0.01 + 3 * accuracy_share) > 0.97
    np.testing.assert_array_equal(scan.mesh.vertices[rest.old_of_new], rest.mesh.vertices)
    before = rigid.transformed(scan.T_design_scan, scan.mesh.vertices)
    high = before[:, 2] > BRACKET.vertices[:, 2].min() + 0.06 * BRACKET.diagonal_mm
    assert len(rest.mesh.vertices) > 0.9 * high.sum()  # what rises from the table is still there


def test_a_cloud_on_a_table_loses_it_too(monkeypatch: pytest.MonkeyPatch) -> None:
    scan = on_table(BRACKET, 0.002, 1, monkeypatch)
    rest, strays = without_table(cleaned(Mesh(scan.mesh.vertices)), BRACKET, 0)
    assert strays.any and 0.05 < len(rest.mesh.vertices) / len(scan.mesh.vertices) < 0.5


@pytest.mark.parametrize("factor", [1.0, 1.05, 10.0, 25.4])
def test_a_flat_part_is_no_table_whatever_its_unit(factor: float) -> None:
    plate = catalogue.FAMILIES["plate"](3).mesh()
    scan = cleaned(Mesh(factor * plate.vertices, plate.faces))
    rest, strays = without_table(scan, plate, 0)
    assert not strays.any and rest is scan


def test_a_bent_plane_is_a_flat_patch_and_a_ball_is_none() -> None:
    rng = np.random.default_rng(0)
    x, y = rng.uniform(-50, 50, (2, 4000))
    bent = np.stack([x, y, 1.5 * (x / 50) ** 2 - (y / 50) ** 3 + rng.normal(0, 0.05, 4000)], axis=1)
    ball = shapes.icosphere(15.0, 4).vertices + np.array([0.0, 0.0, 25.0])
    patch = largest_flat_patch(np.concatenate([bent, ball]), 3.0, 0.3, 0, 0.2)
    assert patch is not None
    assert patch.is_on[:4000].mean() > 0.99 and not patch.is_on[4000:].any()
    assert 100.0 < patch.width_mm < 100.0 * np.sqrt(2)  # a square of 100 mm
    assert largest_flat_patch(ball, 0.3, 0.1, 0, 0.3) is None


def test_the_pose_of_a_part_that_stands_on_a_table_is_found(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    part = catalogue.FAMILIES["bearing block"](3).mesh()
    scan = on_table(part, 0.002, 1, monkeypatch)
    design, file = save(part, tmp_path / "design.ply"), save(scan.mesh, tmp_path / "scan.ply")
    result = register(design, file, settings=COARSE)
    assert result.verdict.status in {"ok", "uncertain"} and result.transform is not None
    found = np.array(result.transform.matrix)
    assert rigid.rms_displacement(found, scan.T_design_scan, scan.mesh.vertices) < 0.02 * part.diagonal_mm
    assert any("table" in note.detail for note in result.warnings if note.code == "stray_component")
