"""Alignments against closed form: a block with one bent wall, motions held, limits that a shift can keep."""

import numpy as np
import pytest
from pydantic import TypeAdapter, ValidationError

from pipeline.core.acceptance import Acceptance
from pipeline.core.alignment import Alignment, LandmarksFit, RpsFit, ToleranceFit
from pipeline.core.errors import PointOffSurface
from pipeline.core.mesh import FloatArray, Mesh
from pipeline.inspection.aligned_points import Landmarks, fit_landmarks, fit_reference_points
from pipeline.inspection.aligned_surface import fit_surface, fit_tolerances
from pipeline.inspection.alignment_types import AlignmentFailed, Found, Placed
from pipeline.kernels import rigid
from pipeline.kernels.surface import Surface
from pipeline.search.types import Matching
from pipeline.stages.registration import evaluate_fit
from tests.support import shapes

SIZE = (40.0, 30.0, 20.0)
BLOCK = shapes.box(SIZE, 4)
DESIGN = Surface(BLOCK)
WALLS = {
    name: {"kind": "box", "min_mm": low, "max_mm": high}
    for name, low, high in (
        ("left", [-1, -1, -1], [0.001, 31, 21]),
        ("bottom", [-1, -1, -1], [41, 31, 0.001]),
        ("all", [-1, -1, -1], [41, 31, 21]),
    )
}


def placed(scan: Mesh, T: FloatArray | None = None, design: Surface = DESIGN) -> Placed:
    fit = evaluate_fit(scan, scan.weights(), design, np.eye(4) if T is None else T, 3.0)
    return Placed(scan, scan.weights(), fit, design, np.zeros(len(design.mesh.faces), np.int64), None, 3.0)


def bent(by_mm: float = 0.6) -> Mesh:
    """The block with its wall at x = 40 leaning outwards: by 0 at the bottom, by `by_mm` at the top."""
    vertices = BLOCK.vertices.copy()
    wall = vertices[:, 0] == SIZE[0]
    vertices[wall, 0] += by_mm * vertices[wall, 2] / SIZE[2]
    return Mesh(vertices, BLOCK.faces)


def alignment(**given: object) -> Alignment:
    found: Alignment = TypeAdapter(Alignment).validate_python(given)
    return found


def surface_fit(scan: Mesh, **given: object) -> Found:
    return fit_surface(placed(scan), alignment(**given))  # type: ignore[arg-type]


def rps_points(*, without: str | None = None) -> list[dict[str, object]]:
    """3-2-1: three on the bottom, two in front, one on the left."""
    places = {
        "A1": ([5, 5, 0], [0, 0, -1]),
        "A2": ([35, 5, 0], [0, 0, -1]),
        "A3": ([20, 25, 0], [0, 0, 1]),
        "B1": ([5, 0, 10], [0, -1, 0]),
        "B2": ([35, 0, 10], [0, 1, 0]),
        "C1": ([0, 15, 10], [1, 0, 0]),
    }
    return [
        {"name": name, "position_mm": place, "direction": direction, "radius_mm": 4}
        for name, (place, direction) in places.items()
        if name != without
    ]


def test_a_best_fit_smears_a_bent_wall_and_reference_points_show_it() -> None:
    scan = bent()
    best = surface_fit(scan, kind="best_fit", regions=[{"region": WALLS["all"]}]).T_design_scan
    smeared = evaluate_fit(scan, scan.weights(), DESIGN, best, 3.0)
    right = BLOCK.vertices[:, 0] == 0
    assert np.abs(smeared.moved[right, 0]).max() > 0.05  # the straight wall looks wrong as well
    found = fit_reference_points(placed(scan, best), RpsFit(kind="rps", points=rps_points()))  # type: ignore[arg-type]
    np.testing.assert_allclose(found.T_design_scan, np.eye(4), atol=1e-6)
    assert found.residual_mm < 1e-6
    assert found.best_fit_residual_mm > 0.01
    assert [point.name for point in found.points] == ["A1", "A2", "A3", "B1", "B2", "C1"]
    shown = evaluate_fit(scan, scan.weights(), DESIGN, found.T_design_scan, 3.0)
    top = (BLOCK.vertices[:, 0] == SIZE[0]) & (BLOCK.vertices[:, 2] == SIZE[2])
    np.testing.assert_allclose(shown.closest.distance[top], 0.6, atol=1e-6)
    np.testing.assert_allclose(shown.closest.distance[right], 0.0, atol=1e-6)


def test_a_best_fit_of_the_straight_walls_shows_it_too() -> None:
    walls = [
        {"region": WALLS["all"]},
        {"region": {**WALLS["left"], "min_mm": [39.9, -1, -1], "max_mm": [41, 31, 21]}},
    ]
    walls[1]["weight"] = 0.0
    found = surface_fit(
        bent().moved(rigid.from_vector(np.array([[0.01, 0, 0, 0.2, 0.1, 0]]))[0]),
        kind="best_fit",
        regions=walls,
    )
    assert found.residual_mm < 1e-6
    assert found.free.shape == (0, 6)


def test_a_fit_of_one_wall_keeps_what_the_wall_does_not_hold() -> None:
    shifted = Mesh(BLOCK.vertices + np.array([0.2, 0.3, 0.1]), BLOCK.faces)
    found = surface_fit(shifted, kind="best_fit", regions=[{"region": WALLS["bottom"]}])
    np.testing.assert_allclose(found.T_design_scan[:3, 3], [0, 0, -0.1], atol=1e-9)
    assert found.free.shape == (3, 6)


@pytest.mark.parametrize(
    ("constraint", "translation"),
    [
        ({"hold": ["tx", "rx", "ry", "rz"]}, [0, -0.3, -0.1]),
        ({"line": {"point_mm": [0, 0, 0], "direction": [0, 5, 0]}}, [0, -0.3, 0]),
        ({"plane": {"normal": [0, 0, 2]}}, [-0.2, -0.3, 0]),
    ],
)
def test_held_motions_stay(constraint: dict[str, object], translation: list[float]) -> None:
    shifted = Mesh(BLOCK.vertices + np.array([0.2, 0.3, 0.1]), BLOCK.faces)
    found = surface_fit(shifted, kind="constrained", **constraint)
    T = found.T_design_scan
    if "line" in constraint:
        np.testing.assert_allclose(T[:3, :3] @ [0, 1, 0], [0, 1, 0], atol=1e-12)
        np.testing.assert_allclose(T[1, 3], -0.3, atol=0.01)
    else:
        np.testing.assert_allclose(T[:3, 3], translation, atol=0.01)
        np.testing.assert_allclose(T[:3, :3], np.eye(3), atol=1e-3)


def test_a_turn_about_a_line_is_found_about_that_line() -> None:
    turned = BLOCK.moved(rigid.from_vector(np.array([[0, 0, 0.03, 0, 0, 0.2]]))[0])
    line = {"point_mm": [0, 0, 7], "direction": [0, 0, 1]}
    T = surface_fit(turned, kind="constrained", line=line).T_design_scan
    np.testing.assert_allclose(
        T @ rigid.from_vector(np.array([[0, 0, 0.03, 0, 0, 0.2]]))[0], np.eye(4), atol=1e-6
    )


def raised(by_mm: float) -> Mesh:
    """The block, the top raised by `by_mm` and the bottom straight."""
    top = BLOCK.vertices[:, 2] == SIZE[2]
    return Mesh(BLOCK.vertices + np.where(top, by_mm, 0.0)[:, None] * [0, 0, 1.0], BLOCK.faces)


def test_a_tolerance_fit_keeps_all_within_limits_that_a_shift_can_keep() -> None:
    scan, limits = raised(0.36), ToleranceFit(kind="tolerance_fit", tolerance_mm=0.2)
    found = fit_tolerances(placed(scan), limits, None, None)
    assert (found.best_fit_residual_mm > 0.05, found.residual_mm) == (True, 0.0)
    fit = evaluate_fit(scan, scan.weights(), DESIGN, found.T_design_scan, 3.0)
    assert DESIGN.signed_distance(fit.moved, fit.closest).max() <= 0.2


def test_a_tolerance_fit_shares_what_cannot_be_kept_between_both_sides() -> None:
    found = fit_tolerances(placed(raised(0.6)), ToleranceFit(kind="tolerance_fit"), None, 0.2)
    np.testing.assert_allclose(found.T_design_scan[2, 3], -0.3, atol=0.01)
    assert found.residual_mm > 0.05


def test_the_limits_of_a_region_hold_in_a_tolerance_fit() -> None:
    region = {"name": "bottom", "region": WALLS["bottom"], "tolerance_mm": 0.05}
    acceptance = Acceptance.model_validate({"tolerance_mm": 0.3, "regions": [region]})
    found = fit_tolerances(placed(raised(0.3)), ToleranceFit(kind="tolerance_fit"), acceptance, None)
    assert found.residual_mm == 0.0
    assert -0.05 <= found.T_design_scan[2, 3] <= 0.0


def test_pairs_of_places_give_the_motion_between_them() -> None:
    truth = rigid.from_vector(np.array([[0.02, -0.01, 0.03, 0.5, 0.2, -0.4]]))[0]
    design = np.array([[0, 0, 0], [40, 0, 0], [0, 30, 20.0]])
    scan = rigid.transformed(rigid.inverse(truth), design)
    pairs = [
        {"name": f"L{k}", "design_mm": a.tolist(), "scan_mm": b.tolist()}
        for k, (a, b) in enumerate(zip(design, scan, strict=True))
    ]
    of_matches = Landmarks(Matching((), None, np.arange(3), np.array([2, 0, 1])), design, scan[[1, 2, 0]])
    for asked in ({"pairs": pairs}, {}, {"design_landmarks": [0, 1, 2]}):
        fit = LandmarksFit.model_validate({"kind": "landmarks", **asked})
        found = fit_landmarks(placed(BLOCK), fit, of_matches)
        np.testing.assert_allclose(found.T_design_scan, truth, atol=1e-9)
        assert found.residual_mm < 1e-9
    two = LandmarksFit.model_validate({"kind": "landmarks", "design_landmarks": [0, 1, 7]})
    with pytest.raises(
        AlignmentFailed,
        match=r"that it uses \(2\) leave a motion free: the rotation about the axis \(1, 0, 0\)",
    ):
        fit_landmarks(placed(BLOCK), two, of_matches)


def test_what_the_scan_does_not_show_is_named() -> None:
    above = BLOCK.faces[(BLOCK.vertices[BLOCK.faces][:, :, 2] > 0).any(axis=1)]
    with pytest.raises(AlignmentFailed, match="does not show its points 'A1', 'A2', 'A3'"):
        points = [{**each, "radius_mm": 3} for each in rps_points()]
        fit_reference_points(placed(_used(Mesh(BLOCK.vertices, above))), RpsFit(kind="rps", points=points))  # type: ignore[arg-type]


def _used(mesh: Mesh) -> Mesh:
    kept, numbers = np.unique(mesh.faces, return_inverse=True)
    return Mesh(mesh.vertices[kept], numbers.reshape(-1, 3))


def test_a_reference_point_off_the_design_is_an_error() -> None:
    points = rps_points()
    points[0]["position_mm"] = [5, 5, -9]
    with pytest.raises(PointOffSurface, match="'A1'"):
        fit_reference_points(placed(BLOCK), RpsFit(kind="rps", points=points))  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("missing", "motion"),
    [
        ("C1", r"the translation along \(1, 0, 0\)"),
        ("B2", r"the rotation about the axis \(0, 0, 1\)"),
        ("A3", r"the rotation about the axis \(1, 0, 0\) through"),
    ],
)
def test_points_that_leave_a_motion_free_are_refused_with_the_motion(missing: str, motion: str) -> None:
    with pytest.raises(ValidationError, match=motion):
        alignment(kind="rps", points=rps_points(without=missing))


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ({"kind": "constrained"}, "exactly one of hold, line and plane"),
        ({"kind": "constrained", "hold": ["tx", "tx"]}, "twice"),
        ({"kind": "constrained", "plane": {"normal": [0, 0, 0]}}, "no length"),
        ({"kind": "rps", "points": [*rps_points(), rps_points()[0]]}, "'A1' is given twice"),
        ({"kind": "best_fit", "regions": [{"region": WALLS["all"], "weight": 0}]}, "every weight is 0"),
        (
            {
                "kind": "landmarks",
                "pairs": [
                    {"name": f"{k}", "design_mm": [k, 0, 0], "scan_mm": [k, k * k, 0]} for k in range(4)
                ],
            },
            r"design_mm leave a motion free: the rotation about the axis \(1, 0, 0\)",
        ),
        ({"kind": "tolerance_fit", "lower_mm": 0.2, "upper_mm": 0.1}, "must be below"),
    ],
)
def test_what_contradicts_is_refused(given: dict[str, object], words: str) -> None:
    with pytest.raises(ValidationError, match=words):
        alignment(**given)
