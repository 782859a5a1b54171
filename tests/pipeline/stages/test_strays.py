"""Strays change nothing: not the part, not its size, not the pose; what is near belongs to the part."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pipeline.core.mesh import FloatArray, Mesh
from pipeline.core.settings import CleanSettings
from pipeline.kernels import sampling
from pipeline.kernels.surface import Surface
from pipeline.stages.clean import Cleaned, clean
from pipeline.stages.strays import (
    only_piece,
    piece_candidates,
    without_off_design,
    without_oversize,
    without_specks,
)
from tests.support import shapes
from tests.support.registering import register
from tests.support.scanners.record import SimulatedScan
from tests.support.scanners.surroundings import joined, with_surroundings
from tests.support.scans import save, scanned
from tests.support.settings import COARSE as QUICK
from tests.support.variants import catalogue
from tests.support.variants.changes import with_pin

PART = shapes.bumpy_blob(4)


def cleaned(mesh: Mesh) -> Cleaned:
    return clean(mesh, "scan", CleanSettings())


def speck(centre: Sequence[float] | FloatArray, radius_mm: float = 0.3) -> Mesh:
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


def near_balls(part: Mesh, gaps_mm: list[float], radius_mm: float, seed: int) -> list[Mesh]:
    """Balls above or below the surface of `part` at random places, each with its gap (below: negative)."""
    samples, surface = sampling.on_surface(part, 500, seed), Surface(part)
    balls: list[Mesh] = []
    for point, normal in zip(samples.points, samples.normals, strict=True):
        offset_mm = np.sign(gaps_mm[len(balls)]) * (abs(gaps_mm[len(balls)]) + radius_mm)
        centre = point + offset_mm * normal
        if surface.closest(centre[None]).distance[0] > 0.98 * abs(offset_mm):  # else another face is nearer
            balls.append(speck(centre.tolist(), radius_mm))
        if len(balls) == len(gaps_mm):
            break
    return balls


NEAR_PARTS = {"blob": PART, "bracket": catalogue.FAMILIES["bracket"](4).mesh(), "cross": shapes.cross(5)}


@settings(max_examples=30, deadline=None)
@given(
    name=st.sampled_from(sorted(NEAR_PARTS)),
    gaps_mm=st.lists(
        st.one_of(st.floats(1.0, 4.0), st.floats(-3.0, -1.0)).filter(lambda gap_mm: abs(gap_mm) >= 1.0),
        min_size=1,
        max_size=10,
    ),
    radius_mm=st.floats(0.05, 0.6),
    seed=st.integers(0, 1000),
)
def test_specks_a_millimetre_off_the_part_or_inside_it_leave_it_as_it_is(
    name: str, gaps_mm: list[float], radius_mm: float, seed: int
) -> None:
    part = NEAR_PARTS[name]
    whole = cleaned(joined([part, *near_balls(part, gaps_mm, radius_mm, seed)]))
    rest, strays = without_specks(whole)
    # A ball within the material of a closed part is a body within another, which cleaning leaves out.
    assert strays.any or whole.report["united_bodies"]
    np.testing.assert_array_equal(rest.mesh.vertices, cleaned(part).mesh.vertices)


@pytest.mark.parametrize("gap_mm", [1.0, 1.5, 4.0])
def test_specks_near_a_cloud_leave_it_as_it_is(gap_mm: float) -> None:
    rng = np.random.default_rng(2)
    dense = shapes.bumpy_blob(5).vertices
    cloud = rng.permutation(dense) + rng.normal(0.0, 0.02, dense.shape)
    balls = near_balls(PART, [gap_mm] * 10, 0.4, 3)
    rest, strays = without_specks(cleaned(Mesh(np.concatenate([cloud, *(b.vertices for b in balls)]))))
    assert strays.any
    np.testing.assert_array_equal(rest.mesh.vertices, cleaned(Mesh(cloud)).mesh.vertices)


def test_a_cloud_of_scan_lines_is_no_dust() -> None:
    """Points lie denser along the lines than across: each line hangs together."""
    x, y = np.meshgrid(np.arange(0.0, 60.0, 0.1), np.arange(0.0, 40.0, 1.0), indexing="ij")
    points = np.stack([x.ravel(), y.ravel(), np.sin(x.ravel() / 8)], axis=1)
    rest, strays = without_specks(cleaned(Mesh(points)))
    assert not strays.any and len(rest.mesh.vertices) == len(points)


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


@pytest.mark.parametrize("seed", range(6))
def test_a_part_with_a_body_beside_it_is_no_table_in_any_pose(seed: int) -> None:
    bracket = catalogue.FAMILIES["bracket"](1).mesh()
    pair = with_pin(bracket).moved(shapes.motion(seed))
    _, strays = without_oversize(cleaned(pair), bracket)
    assert not strays.any


def test_what_lies_nowhere_on_the_design_is_left_out() -> None:
    block = Mesh(PART.vertices * 0.4 + np.array([45.0, 0.0, 0.0]), PART.faces)
    both = cleaned(joined([PART, block]))
    surface = Surface(PART)
    distance = surface.closest(both.mesh.vertices).distance
    rest, strays = without_off_design(both, distance, 1.0, surface)
    assert strays.any and len(rest.mesh.vertices) == len(PART.vertices)
    only, _ = only_piece(both, 0)
    np.testing.assert_array_equal(only.mesh.vertices, rest.mesh.vertices)


@pytest.mark.parametrize(("width_deg", "is_candidate"), [(40.0, False), (60.0, True)])
def test_a_piece_is_the_part_only_where_it_shows_enough_of_it(width_deg: float, is_candidate: bool) -> None:
    outward = PART.vertices / np.linalg.norm(PART.vertices, axis=1, keepdims=True)
    cap = outward[:, 2] > np.cos(np.radians(width_deg))  # 12 % of the part, and 25 %
    used = np.unique(faces := PART.faces[cap[PART.faces].all(axis=1)])
    piece = Mesh(PART.vertices[used], np.searchsorted(used, faces))
    beside = shapes.torus(10.0, 3.0)
    both = joined([piece, Mesh(beside.vertices + np.array([0.0, 0.0, 60.0]), beside.faces)])
    assert (0 in piece_candidates(cleaned(both), PART)) is is_candidate


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


@pytest.mark.parametrize("as_cloud", [False, pytest.param(True, marks=pytest.mark.nightly)])
def test_ten_specks_near_and_far_change_neither_status_nor_pose(tmp_path: Path, as_cloud: bool) -> None:
    scan = scanned(shapes.motion(3), levels=5 if as_cloud else 4)
    gaps_mm = [1.0, 1.2, 2.0, 3.0, 4.0, 8.0, 20.0, 60.0, 300.0, 1.5]
    added = joined([scan, *near_balls(scan, gaps_mm, 0.4, 1)])
    made = (scan, added) if not as_cloud else (Mesh(scan.vertices), Mesh(added.vertices))
    ending = "xyz" if as_cloud else "ply"
    design = save(PART, tmp_path / "design.ply")
    files = [save(mesh, tmp_path / f"{k}.{ending}") for k, mesh in enumerate(made)]
    alone, beside = (register(design, file, settings=QUICK) for file in files)
    assert alone.verdict.status == beside.verdict.status == "ok"
    assert alone.transform is not None and beside.transform is not None
    np.testing.assert_allclose(beside.transform.matrix, alone.transform.matrix, atol=1e-6)
