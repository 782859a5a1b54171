"""Checks against plates with known deviations, regions against their formulas, and the decision."""

import numpy as np
import pytest
from pydantic import ValidationError

from pipeline.core.acceptance import Acceptance, RegionLimits
from pipeline.core.errors import PointOffSurface, UnknownRegion
from pipeline.core.results import Check, Finding, Verdict
from pipeline.inspection import regions
from pipeline.inspection.checks import Part, checks_of
from pipeline.inspection.inspect import decide, without_pose
from pipeline.inspection.limits_check import passes, rule
from pipeline.inspection.measured_surface import MeasuredSurface
from pipeline.inspection.patches import patches
from pipeline.kernels.surface import Surface
from tests.pipeline.inspection.surfaces import bump, measured, plate

BOX = {"kind": "box", "min_mm": [0, 0, 0], "max_mm": [1, 1, 1]}
OK = Verdict(status="ok", confidence=0.97, findings=[])


def part_of(surface: MeasuredSurface, verdict: Verdict = OK, seen: float = 0.8) -> Part:
    return Part(surface, patches(surface, 2.0), Surface(plate()), seen, verdict)


def checked(surface: MeasuredSurface, **acceptance: object) -> dict[str, Check]:
    found = checks_of(part_of(surface), Acceptance.model_validate(acceptance))
    return {check.name: check for check in found}


PLATE = Surface(plate())
BUMPED = measured(lambda p: bump(p, (10, 10), 4.0, 0.3) - bump(p, (30, 30), 3.0, 0.15))


@pytest.mark.parametrize(
    ("tolerance", "passed"), [(0.4, (True, True)), (0.2, (False, True)), (0.1, (False, False))]
)
def test_without_a_share_every_patch_must_lie_between_the_limits(
    tolerance: float, passed: tuple[bool, bool]
) -> None:
    found = checked(BUMPED, tolerance_mm=tolerance)
    assert (found["highest"].value, found["lowest"].value) == pytest.approx((0.3, -0.15))
    assert (found["highest"].passed, found["lowest"].passed) == passed


def test_the_place_of_the_highest_patch_is_on_the_bump() -> None:
    position = checked(BUMPED, tolerance_mm=0.1)["highest"].position_mm
    assert position is not None
    assert np.hypot(position[0] - 10, position[1] - 10) <= 4.0


def test_a_share_of_the_area_may_be_beyond_the_limits() -> None:
    found = checked(BUMPED, tolerance_mm=0.1, min_within=0.9)
    beyond = np.pi * (4.0**2 + 3.0**2) / 39.0**2
    assert set(found) == {"within"}
    assert found["within"].value == pytest.approx(1 - beyond, abs=0.003)
    assert found["within"].passed is True
    assert checked(BUMPED, tolerance_mm=0.1, min_within=0.97)["within"].passed is False


def test_the_largest_deviation_holds_beside_the_share() -> None:
    found = checked(BUMPED, tolerance_mm=0.1, min_within=0.9, max_deviation_mm=0.25)
    assert {name: check.passed for name, check in found.items()} == {
        "within": True,
        "highest": False,
        "lowest": True,
    }


def test_one_sided_limits_check_one_side() -> None:
    assert set(checked(BUMPED, upper_mm=0.2)) == {"highest"}
    assert set(checked(BUMPED, lower_mm=-0.2)) == {"lowest"}


def test_a_region_has_its_own_limits_and_leaves_the_rest_to_those_of_the_part() -> None:
    around = {"kind": "sphere", "centre_mm": [10, 10, 0], "radius_mm": 6}
    region = {"name": "boss", "region": around, "upper_mm": 0.35}
    found = checked(BUMPED, tolerance_mm=0.2, regions=[region])
    assert found["boss: highest"].value == pytest.approx(0.3)
    assert found["boss: highest"].passed is True
    assert found["highest"].value == pytest.approx(0.0)
    assert found["highest"].passed is True


def test_coverage_and_confidence_are_compared_with_what_is_asked_for() -> None:
    found = checked(BUMPED, min_coverage=0.9, min_confidence=0.95)
    assert (found["coverage"].passed, found["confidence"].passed) == (False, True)


def test_points_are_measured_where_they_are() -> None:
    points = [
        {"name": "on", "position_mm": [10, 10, 0], "radius_mm": 2, "tolerance_mm": 0.2},
        {"name": "off", "position_mm": [20, 20, 0.1], "radius_mm": 2, "tolerance_mm": 0.2},
    ]
    found = checked(BUMPED, points=points)
    assert (found["on"].value, found["off"].value) == pytest.approx((0.3, 0.0))
    assert (found["on"].passed, found["off"].passed) == (False, True)
    assert found["on"].n == pytest.approx(np.pi * 2**2 / 0.25**2, rel=0.05)


def test_distances_are_of_the_measured_points() -> None:
    points = [
        {"name": name, "position_mm": [x, 10, 0], "radius_mm": 2, "tolerance_mm": 1}
        for name, x in (("a", 10), ("b", 25))
    ]
    between = {"name": "ab", "first": "a", "second": "b", "tolerance_mm": 0.01}
    found = checked(BUMPED, points=points, distances=[between])
    assert found["ab"].value == pytest.approx(np.hypot(15, 0.3) - 15)
    assert found["ab"].passed is True


def test_a_point_that_the_scan_does_not_show_is_not_measured() -> None:
    surface = measured(lambda p: np.zeros(len(p)))
    surface.normal[:] = [0.0, 0.0, -1.0]
    points = [{"name": "p", "position_mm": [10, 10, 0], "radius_mm": 2, "tolerance_mm": 0.2}]
    assert checked(surface, points=points)["p"].passed is None


def test_a_point_off_the_surface_is_an_error_that_names_it() -> None:
    point = {"name": "P7", "position_mm": [10, 10, 5], "radius_mm": 2, "tolerance_mm": 0.2}
    with pytest.raises(PointOffSurface, match=r"'P7' is 5 mm off"):
        checked(BUMPED, points=[point])
    with pytest.raises(PointOffSurface, match="faces in the direction of the normal"):
        checked(BUMPED, points=[{**point, "position_mm": [10, 10, 0], "normal": [0, 0, -1]}])


@pytest.mark.parametrize(
    ("region", "inside"),
    [
        (
            {"kind": "box", "min_mm": [0, 0, 0], "max_mm": [1, 2, 3]},
            lambda p: (p <= [1, 2, 3]).all(1) & (p >= 0).all(1),
        ),
        (
            {"kind": "sphere", "centre_mm": [0, 0, 1], "radius_mm": 2},
            lambda p: ((p - [0, 0, 1]) ** 2).sum(1) <= 4,
        ),
        (
            {"kind": "cylinder", "start_mm": [0, 0, -1], "end_mm": [0, 0, 2], "radius_mm": 1.5},
            lambda p: (np.hypot(p[:, 0], p[:, 1]) <= 1.5) & (p[:, 2] >= -1) & (p[:, 2] <= 2),
        ),
    ],
)
def test_regions_of_space(region: dict[str, object], inside: object) -> None:
    points = np.random.default_rng(0).uniform(-4, 4, (5000, 3))
    limits = RegionLimits.model_validate({"name": "r", "region": region, "tolerance_mm": 1})
    found = regions.members(
        limits.region, "r", points, np.zeros(5000, np.int64), np.zeros(1, np.int64), PLATE
    )
    assert callable(inside)
    assert (found == inside(points)).all()
    assert 0 < found.sum() < 5000


def test_segments_and_faces_by_number() -> None:
    segment_of_face, face = np.array([0, 0, 1, 2]), np.array([3, 0, 2, 1])
    for region, expected in (
        ({"kind": "segments", "segments": [0]}, [False, True, False, True]),
        ({"kind": "faces", "faces": [2, 3]}, [True, False, True, False]),
    ):
        limits = RegionLimits.model_validate({"name": "r", "region": region, "tolerance_mm": 1})
        found = regions.members(limits.region, "r", np.zeros((4, 3)), face, segment_of_face, PLATE)
        assert found.tolist() == expected
    unknown = RegionLimits.model_validate(
        {"name": "rim", "region": {"kind": "segments", "segments": [3]}, "tolerance_mm": 1}
    )
    with pytest.raises(UnknownRegion, match=r"'rim' names segment 3, but the design has 3 \(0 to 2\)"):
        regions.members(unknown.region, "rim", np.zeros((4, 3)), face, segment_of_face, PLATE)


@pytest.mark.parametrize(
    ("value", "uncertainty", "passed"),
    [
        (0.19, None, True),
        (0.2, None, True),
        (0.21, None, False),
        (0.14, 0.05, True),
        (0.19, 0.05, None),
        (0.24, 0.05, None),
        (0.26, 0.05, False),
        (-0.26, 0.05, False),
        (None, None, None),
    ],
)
def test_the_decision_rule(value: float | None, uncertainty: float | None, passed: bool | None) -> None:
    assert passes(value, -0.2, 0.2, uncertainty) is passed


def test_the_rule_is_stated() -> None:
    assert "simple acceptance" in rule(Acceptance(tolerance_mm=0.2))
    assert "ISO 14253-1" in rule(Acceptance(tolerance_mm=0.2, uncertainty_mm=0.02))


@pytest.mark.parametrize("status", ["uncertain", "ambiguous", "under_constrained", "units_suspect"])
def test_nothing_is_judged_under_an_alignment_that_is_not_ok(status: str) -> None:
    verdict = Verdict.model_validate({"status": status, "confidence": 0.5, "findings": []})
    acceptance = Acceptance(tolerance_mm=1.0)
    found = checks_of(part_of(BUMPED, verdict), acceptance)
    assert all(check.passed for check in found)
    decision, reasons = decide(verdict, found, acceptance)
    assert decision == "not_judged"
    assert status.replace("_", " ") in reasons[0]


def doubtful(*codes: str, same_part: float = 0.9, pose: float = 0.95) -> Verdict:
    findings = [Finding(code=code, detail="", value=None) for code in codes]
    probabilities = {"confidence": same_part * pose, "same_part": same_part, "pose": pose}
    return Verdict(status="uncertain", findings=findings, **probabilities)


@pytest.mark.parametrize(
    ("verdict", "decision"),
    [
        (doubtful("local_difference"), "fail"),
        (doubtful("missing_material", "few_landmarks"), "fail"),
        (doubtful("local_difference", "high_residual"), "not_judged"),
        (doubtful("local_difference", pose=0.8), "not_judged"),
        (doubtful("local_difference", same_part=0.8), "not_judged"),
        (doubtful("stretched"), "not_judged"),
    ],
)
def test_a_part_may_fail_where_only_its_shape_casts_doubt(verdict: Verdict, decision: str) -> None:
    acceptance = Acceptance(tolerance_mm=0.2)
    assert decide(verdict, checks_of(part_of(BUMPED, verdict), acceptance), acceptance)[0] == decision
    wide = Acceptance(tolerance_mm=0.5)
    assert decide(verdict, checks_of(part_of(BUMPED, verdict), wide), wide)[0] == "not_judged"


def test_the_decision_follows_from_the_checks() -> None:
    for tolerance, decision in ((0.4, "pass"), (0.2, "fail")):
        acceptance = Acceptance(tolerance_mm=tolerance)
        assert decide(OK, checks_of(part_of(BUMPED), acceptance), acceptance)[0] == decision
    assert decide(OK, [], None)[0] == "not_judged"
    assert decide(OK, [], Acceptance())[0] == "not_judged"


def test_reasons_name_value_limit_and_place() -> None:
    acceptance = Acceptance(upper_mm=0.2)
    _, reasons = decide(OK, checks_of(part_of(BUMPED), acceptance), acceptance)
    assert reasons[0].startswith("highest: the deviation of 0.300 mm is above its limit of 0.200 mm, at (")


def test_the_tolerance_of_the_job_is_the_limit_where_there_is_none() -> None:
    assert Acceptance(min_within=0.9).with_tolerance(0.2).upper == 0.2
    assert Acceptance(upper_mm=0.3).with_tolerance(0.2).lower is None
    with pytest.raises(ValueError, match="needs tolerance_mm"):
        Acceptance(min_within=0.9).with_tolerance(None)


@pytest.mark.parametrize(
    ("wrong", "reason"),
    [
        ({"tolerance_mm": 0.1, "upper_mm": 0.2}, "not both"),
        ({"lower_mm": 0.2, "upper_mm": 0.1}, "must be below"),
        (
            {"regions": [{"name": "r", "region": BOX, "max_deviation_mm": 1, "min_within": 0.9}]},
            "needs tolerance_mm",
        ),
        ({"tolerance_mm": -0.1}, "greater than 0"),
        ({"regions": [{"name": "r", "region": {"kind": "segments", "segments": [0]}}]}, "has no limits"),
        ({"distances": [{"name": "d", "first": "a", "second": "b", "tolerance_mm": 1}]}, "none of `points`"),
        (
            {
                "points": [
                    {"name": "a", "position_mm": [0, 0, 0], "radius_mm": 1, "tolerance_mm": 1}
                    for _ in range(2)
                ]
            },
            "given twice",
        ),
    ],
)
def test_limits_that_contradict_are_refused(wrong: dict[str, object], reason: str) -> None:
    with pytest.raises(ValidationError, match=reason):
        Acceptance.model_validate(wrong)


def test_without_a_pose_nothing_is_measured() -> None:
    verdict = Verdict(status="no_match", confidence=0.0, findings=[])
    found = without_pose(verdict, Acceptance(tolerance_mm=0.2))
    assert (found.decision, found.checks, found.extremes, found.patch_mm) == ("not_judged", [], [], None)
    assert found.reasons == ["the alignment is no match, so the part is not judged"]


def test_segments_by_a_place_are_those_under_it_whatever_their_numbers() -> None:
    left = PLATE.mesh.vertices[PLATE.mesh.faces][:, :, 0].max(axis=1) <= 20
    region = {"name": "r", "region": {"kind": "segments_at", "places_mm": [[5, 7, 0.1]]}, "tolerance_mm": 1}
    limits = RegionLimits.model_validate(region)
    face = np.arange(len(left))
    for numbers in (np.where(left, 0, 1), np.where(left, 7, 3)):
        found = regions.members(limits.region, "r", np.zeros((len(left), 3)), face, numbers, PLATE)
        assert (found == left).all()
    region["region"] = {"kind": "segments_at", "places_mm": [[5, 7, 0], [5, 7, 4]]}
    far = RegionLimits.model_validate(region)
    with pytest.raises(PointOffSurface, match="place 1 of region 'r' is 4 mm off"):
        regions.members(far.region, "r", np.zeros((1, 3)), face[:1], left.astype(int), PLATE)
