"""Deviation against closed forms: parts whose print is off by a known amount everywhere, or on a known
part of them.
"""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pipeline.core.mesh import FloatArray, Mesh
from pipeline.core.results import DesignDeviation, Deviation
from pipeline.core.settings import DeviationSettings
from pipeline.kernels import rigid
from pipeline.kernels.surface import Surface
from pipeline.stages.deviation import Deviations, deviation, deviation_of_design, side_of, weighted_quantiles
from pipeline.stages.registration import evaluate_fit
from tests.support import shapes


def measured(
    design: Mesh, scan: Mesh, tolerance_mm: float | None = None, T: FloatArray | None = None
) -> Deviations:
    """Under the pose T, by default as they lie; every face of the design is a segment by its main
    direction.
    """
    surface = Surface(design)
    found = evaluate_fit(
        scan, scan.weights(), surface, np.eye(4) if T is None else T, 0.02 * design.diagonal_mm
    )
    normals = design.face_cross_mm2()
    segment = (2 * np.abs(normals).argmax(axis=1) + (normals.sum(axis=1) > 0)).astype(np.int32)
    return deviation(scan, surface, found, segment, tolerance_mm, DeviationSettings())


def summary(*given: object, **more: object) -> Deviation:
    found = measured(*given, **more).summary  # type: ignore[arg-type]
    assert found is not None
    return found


def of_design(design: Mesh, scan: Mesh, tolerance_mm: float | None = None) -> DesignDeviation | None:
    surface = Surface(design)
    inlier = 0.02 * design.diagonal_mm
    found = evaluate_fit(scan, scan.weights(), surface, np.eye(4), inlier)
    return deviation_of_design(
        scan, None if scan.is_cloud else Surface(scan), surface, found, inlier, tolerance_mm
    )


def scaled(mesh: Mesh, factor: float) -> Mesh:
    return Mesh(mesh.vertices * factor, mesh.faces)


@pytest.mark.parametrize("offset_mm", [0.3, -0.3])
def test_an_offset_sphere_is_off_by_the_offset_everywhere(offset_mm: float) -> None:
    design = shapes.icosphere(10.0, levels=4)
    scan = scaled(design, 1 + offset_mm / 10.0)
    found = summary(design, scan, tolerance_mm=0.2)
    for value in (found.mean_mm, found.min_mm, found.max_mm, found.p01_mm, found.p50_mm, found.p99_mm):
        assert value == pytest.approx(
            offset_mm, abs=2e-3
        )  # facets of the design lie a little inside its sphere
    assert found.rms_mm == pytest.approx(0.3, abs=2e-3) and found.sd_mm < 2e-3
    assert (found.within, found.above, found.below) == ((0.0, 1.0, 0.0) if offset_mm > 0 else (0.0, 0.0, 1.0))
    assert found.sign == "closed"
    back = of_design(design, scan, tolerance_mm=0.2)
    assert back is not None and back.seen == pytest.approx(1.0)
    assert back.mean_mm == pytest.approx(offset_mm, abs=3e-3) and back.sd_mm < 3e-3


def test_a_shrunk_box_is_inside_by_half_of_what_its_edge_lost() -> None:
    design = shapes.box((10.0, 10.0, 10.0), levels=3)
    centred = Mesh(design.vertices - 5.0, design.faces)
    found = summary(centred, scaled(centred, 0.98))
    assert (found.mean_mm, found.rms_mm) == (pytest.approx(-0.1), pytest.approx(0.1))
    assert found.sd_mm == pytest.approx(0.0, abs=1e-9)
    assert [each.mean_mm for each in found.by_segment] == [pytest.approx(-0.1)] * 6
    back = of_design(centred, scaled(centred, 0.98))
    assert back is not None and back.max_mm == pytest.approx(-0.1)
    assert back.min_mm == pytest.approx(-0.1 * np.sqrt(3))  # its corners


def test_a_stepped_block_has_its_shares_of_the_area() -> None:
    """One half of the top 0.5 mm too high: that half of the top, by area, and nothing else."""
    step_mm, size = 0.5, 20.0
    design = shapes.box((size, size, size), levels=5)
    x, y, z = design.vertices.T
    raised = np.where((z == size) & (x > size / 2), step_mm, 0.0)
    scan = Mesh(np.column_stack([x, y, z + raised]), design.faces)
    found = measured(design, scan, tolerance_mm=0.25)
    assert found.summary is not None
    above = found.signed_mm > 0.25
    np.testing.assert_allclose(found.signed_mm[above], step_mm)
    np.testing.assert_allclose(found.signed_mm[~above], 0.0, atol=1e-12)
    # Of the scan's area by vertices: the raised ones, of which the outer ones share area with the walls below
    # them.
    assert found.summary.above == pytest.approx(scan.weights()[raised > 0].sum())
    assert found.summary.below == 0.0
    assert found.summary.mean_mm == pytest.approx(step_mm * found.summary.above)
    assert found.summary.rms_mm == pytest.approx(step_mm * np.sqrt(found.summary.above))
    top = next(each for each in found.summary.by_segment if each.segment == 5)
    assert top.mean_mm == pytest.approx(step_mm / 2, rel=0.1)


def test_both_sides_of_a_thin_wall_have_their_sign() -> None:
    wall = shapes.box((20.0, 20.0, 0.05), levels=4)
    too_thick = Mesh(
        wall.vertices + np.where(wall.vertices[:, 2:] > 0.02, 1.0, -1.0) * [0, 0, 0.01], wall.faces
    )
    too_thin = Mesh(
        wall.vertices - np.where(wall.vertices[:, 2:] > 0.02, 1.0, -1.0) * [0, 0, 0.01], wall.faces
    )
    rim = (np.abs(wall.vertices[:, :2] - 10.0) == 10.0).any(axis=1)
    np.testing.assert_allclose(measured(wall, too_thick).signed_mm[~rim], 0.01, atol=1e-9)
    thin = measured(wall, too_thin).signed_mm
    np.testing.assert_allclose(thin[~rim], -0.01, atol=1e-9)
    np.testing.assert_allclose(thin[rim], 0.0, atol=1e-9)  # they lie on the rim's own faces


def test_a_broken_off_fin_is_seen_from_the_design_only() -> None:
    plate = shapes.box((20.0, 20.0, 2.0), levels=4)
    x, y, z = plate.vertices.T
    fin = np.where((np.abs(x - 10) < 0.7) & (z == 2.0) & (y > 4) & (y < 16), 6.0, 0.0)
    design = Mesh(np.column_stack([x, y, z + fin]), plate.faces)
    forth = summary(design, plate, tolerance_mm=0.1)
    assert forth.max_mm == pytest.approx(0.0, abs=1e-9)
    back = of_design(design, plate, tolerance_mm=0.1)
    assert (
        back is not None
        and back.min_mm == pytest.approx(-6.0)
        and back.max_mm == pytest.approx(0.0, abs=1e-9)
    )
    assert back.below is not None and back.below == pytest.approx(design.weights()[fin > 0].sum())


@pytest.mark.parametrize("inside_out", [False, True])
def test_what_a_scan_does_not_show_is_not_counted(inside_out: bool) -> None:
    """Half a sphere, 0.1 mm too large; which side its own faces look to does not matter."""
    design = shapes.icosphere(10.0, levels=4)
    whole = scaled(design, 1.01)
    upper = (whole.vertices[whole.faces][:, :, 2] > 0).all(axis=1)
    used = np.unique(whole.faces[upper])
    new = np.zeros(len(whole.vertices), dtype=np.int32)
    new[used] = np.arange(len(used), dtype=np.int32)
    faces = new[whole.faces[upper]]
    scan = Mesh(whole.vertices[used], faces[:, ::-1].copy() if inside_out else faces)
    back = of_design(design, scan)
    assert back is not None
    assert back.seen == pytest.approx(0.5, abs=0.06)
    assert back.mean_mm == pytest.approx(0.1, abs=3e-3) and back.sd_mm < 3e-3


def test_points_have_a_sign_by_the_design() -> None:
    design = shapes.icosphere(10.0, levels=3)
    points = Mesh(shapes.icosphere(10.2, levels=5).vertices)
    found = summary(design, points)
    assert found.min_mm > 0.19 and found.n == len(points.vertices)
    back = of_design(design, points)
    assert back is not None and back.min_mm > 0.19 and back.seen == pytest.approx(1.0)
    assert of_design(design, Mesh(points.vertices * 2)) is None  # nothing of it is near


def test_an_open_design_has_the_side_its_faces_look_to() -> None:
    plane = shapes.grid_plane(30, 30)
    above = Mesh(np.random.default_rng(0).uniform([3, 3, 0.2], [26, 26, 0.2], (500, 3)))
    found = summary(plane, above)
    assert (found.sign, found.mean_mm) == ("open", pytest.approx(0.2))
    turned = summary(Mesh(plane.vertices, plane.faces[:, ::-1].copy()), above)
    assert (turned.sign, turned.mean_mm) == ("open", pytest.approx(-0.2))


def moebius(around: int = 60, across: int = 4) -> Mesh:
    """A strip with one side only."""
    turn = np.linspace(0, 2 * np.pi, around, endpoint=False)
    wide = np.linspace(-2.0, 2.0, across)
    radius = 10.0 + wide[None, :] * np.cos(turn[:, None] / 2)
    vertices = np.stack(
        [
            radius * np.cos(turn[:, None]),
            radius * np.sin(turn[:, None]),
            np.broadcast_to(wide, (around, across)) * np.sin(turn[:, None] / 2),
        ],
        axis=2,
    ).reshape(-1, 3)
    faces = []
    for i in range(around):
        for j in range(across - 1):
            a, b = i * across + j, i * across + j + 1
            k = (i + 1) % around
            c, d = (k * across + j, k * across + j + 1) if k else (across - 1 - j, across - 2 - j)
            faces += [(a, c, b), (b, c, d)]
    return Mesh(vertices, np.array(faces, dtype=np.int32))


def test_a_design_with_one_side_has_no_sign() -> None:
    strip = moebius()
    assert side_of(strip) == "none"
    near = Mesh(strip.vertices[strip.faces].mean(axis=1) + np.random.default_rng(0).normal(0, 0.05, (360, 3)))
    found = summary(strip, near, tolerance_mm=0.5)
    assert found.sign == "none" and found.min_mm >= 0 and found.below == 0
    back = of_design(strip, near)
    assert back is None or back.min_mm >= 0


def test_a_rigid_motion_of_the_scan_changes_nothing() -> None:
    design = shapes.bumpy_blob(levels=3)
    scan = Mesh(design.vertices * 1.004 + 0.01 * np.sin(design.vertices), design.faces)
    T_scan_design = shapes.motion(5)
    moved = Mesh(rigid.transformed(T_scan_design, scan.vertices), scan.faces)
    here = measured(design, scan).signed_mm
    there = measured(design, moved, T=rigid.inverse(T_scan_design)).signed_mm
    np.testing.assert_allclose(there, here, atol=1e-9)


@given(st.lists(st.tuples(st.floats(-9, 9), st.floats(0.01, 5)), min_size=4, max_size=40), st.floats(0.1, 5))
def test_rms_mean_and_sd_belong_together_and_shares_make_one(
    rows: list[tuple[float, float]], tolerance_mm: float
) -> None:
    """Points over a wide plane, as high as drawn."""
    plane = Mesh(
        np.array([[-99.0, -99, 0], [99, -99, 0], [99, 99, 0], [-99, 99, 0]]),
        np.array([[0, 1, 2], [0, 2, 3]], np.int32),
    )
    heights = np.array([height for height, _ in rows])
    scan = Mesh(np.column_stack([np.arange(len(rows)) + 0.25, np.zeros(len(rows)), heights]))
    found = summary(plane, scan, tolerance_mm=tolerance_mm)
    assert found.rms_mm**2 == pytest.approx(found.mean_mm**2 + found.sd_mm**2, abs=1e-12)
    assert found.mean_mm == pytest.approx(heights.mean()) and found.sd_mm == pytest.approx(
        heights.std(), abs=1e-12
    )
    assert found.mean_abs_mm == pytest.approx(np.abs(heights).mean())
    assert found.within is not None and found.above is not None and found.below is not None
    assert found.within + found.above + found.below == pytest.approx(1.0)
    assert found.above == pytest.approx((heights > tolerance_mm).mean())
    weights = np.array([weight for _, weight in rows])
    assert weighted_quantiles(heights, weights, np.array([1.0]))[0] == heights.max()
