"""Strays change nothing: not the part, not its size, not the pose; what is near belongs to the part."""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pipeline.core.mesh import Mesh
from pipeline.core.settings import CleanSettings
from pipeline.kernels.surface import Surface
from pipeline.stages.clean import Cleaned, clean
from pipeline.stages.strays import only_piece, without_off_design, without_oversize, without_specks
from tests.support import shapes
from tests.support.registering import register
from tests.support.scanners.record import SimulatedScan
from tests.support.scanners.surroundings import joined, with_surroundings
from tests.support.scans import save, scanned
from tests.support.settings import COARSE as QUICK

PART = shapes.bumpy_blob(4)


def cleaned(mesh: Mesh) -> Cleaned:
    return clean(mesh, "scan", CleanSettings())


def speck(centre: list[float], radius_mm: float = 0.3) -> Mesh:
    ball = shapes.icosphere(radius_mm, 0)
    return Mesh(ball.vertices + centre, ball.faces)


@settings(max_examples=25, deadline=None)
@given(
    st.lists(
        st.tuples(st.integers(0, 2**31), st.floats(2.5, 200.0)),
        min_size=1,
        max_size=10,
        unique_by=lambda x: x[0],
    ),
    st.booleans(),
)
def test_specks_anywhere_around_leave_the_part_as_it_is(
    places: list[tuple[int, float]], as_cloud: bool
) -> None:
    balls = []
    for seed, distance in places:
        direction = np.random.default_rng(seed).normal(size=3)
        balls.append(speck(distance * 25.0 * direction / np.linalg.norm(direction)))
    both = joined([PART, *balls])
    mesh = Mesh(both.vertices) if as_cloud else both
    alone = Mesh(PART.vertices) if as_cloud else PART
    rest, strays = without_specks(cleaned(mesh))
    np.testing.assert_array_equal(rest.mesh.vertices, cleaned(alone).mesh.vertices)
    np.testing.assert_array_equal(rest.mesh.faces, cleaned(alone).mesh.faces)
    np.testing.assert_array_equal(mesh.vertices[rest.old_of_new], rest.mesh.vertices)
    (note,) = strays.notes("scan")
    assert note.code == "stray_component" and "left out" in note.detail


def test_a_small_piece_that_touches_the_part_belongs_to_it() -> None:
    top = PART.vertices[int(PART.vertices[:, 2].argmax())]
    rest, strays = without_specks(cleaned(joined([PART, speck(top.tolist())])))
    assert not strays.any and len(rest.mesh.vertices) > len(PART.vertices)


def test_a_part_in_many_small_pieces_is_no_dust() -> None:
    row = joined([speck([3.0 * k, 0.0, 0.0], 1.0) for k in range(60)])
    rest, strays = without_specks(cleaned(row))
    assert not strays.any and len(rest.mesh.vertices) == len(row.vertices)


def test_a_table_is_left_out_and_a_scan_in_another_unit_is_not() -> None:
    table = shapes.grid_plane(40, 40, step_mm=3.0)
    below = Mesh(table.vertices - np.array([60.0, 60.0, 40.0]), table.faces)
    rest, strays = without_oversize(cleaned(joined([PART, below])), PART)
    assert strays.any and len(rest.mesh.vertices) == len(PART.vertices)
    larger = Mesh(25.4 * PART.vertices, PART.faces)
    rest, strays = without_oversize(cleaned(larger), PART)
    assert not strays.any and len(rest.mesh.vertices) == len(larger.vertices)


def test_what_lies_nowhere_on_the_design_is_left_out() -> None:
    block = Mesh(PART.vertices * 0.4 + np.array([45.0, 0.0, 0.0]), PART.faces)
    both = cleaned(joined([PART, block]))
    surface = Surface(PART)
    distance = surface.closest(both.mesh.vertices).distance
    rest, strays = without_off_design(both, distance, 1.0, surface)
    assert strays.any and len(rest.mesh.vertices) == len(PART.vertices)
    only, _ = only_piece(both, 0)
    np.testing.assert_array_equal(only.mesh.vertices, rest.mesh.vertices)


@pytest.mark.parametrize(
    "kind",
    ["clamp", *(pytest.param(kind, marks=pytest.mark.nightly) for kind in ("table", "supports", "specks"))],
)
def test_surroundings_change_neither_status_nor_pose(tmp_path: Path, kind: str) -> None:
    scan = scanned(shapes.motion(3))
    design = save(PART, tmp_path / "design.ply")
    alone = register(design, save(scan, tmp_path / "alone.ply"), settings=QUICK)
    simulated = SimulatedScan(scan, np.eye(4), 0.0, np.ones(len(scan.vertices), dtype=np.bool_))
    added = with_surroundings(simulated, kind, np.random.default_rng(1)).mesh
    beside = register(design, save(added, tmp_path / "beside.ply"), settings=QUICK)
    assert alone.verdict.status == beside.verdict.status == "ok"
    assert alone.transform is not None and beside.transform is not None
    np.testing.assert_allclose(beside.transform.matrix, alone.transform.matrix, atol=1e-6)
    assert [note.code for note in beside.warnings].count("stray_component") >= 1
    assert beside.scan is not None and 0 < beside.scan.left_out_share < 1
