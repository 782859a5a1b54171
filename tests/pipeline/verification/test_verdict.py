"""The verdict tells the truth about units, mirror images, symmetric parts and parts that can move."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import pipeline
from pipeline import MeshFile
from pipeline.analysis.mesh_analysis import analyse_mesh
from pipeline.analysis.scan_registration import MatchedScan, match_scan, register_scan
from pipeline.core.job_parameters import JobParameters
from pipeline.core.mesh import Mesh
from pipeline.core.timing import silent
from pipeline.kernels import rigid
from pipeline.kernels.surface import Surface
from pipeline.stages.matching import match_landmarks
from tests.support import shapes
from tests.support.designs import design_of
from tests.support.registering import register
from tests.support.scanners.structured_light import structured_light
from tests.support.scans import noisy, save, scanned
from tests.support.settings import COARSE as QUICK
from tests.support.shapes import cross
from tests.support.variants import catalogue
from tests.support.variants.changes import longest_axis, stretched


def codes(result: pipeline.RegistrationResult) -> set[str]:
    return {finding.code for finding in result.verdict.findings}


@pytest.mark.parametrize(
    ("per_mm", "factor"),
    [(25.4, 25.4), *(pytest.param(x, x, marks=pytest.mark.nightly) for x in (1000.0, 0.1))],
)
def test_a_scan_in_another_unit_is_told_with_the_factor_and_the_pose(
    tmp_path: Path, per_mm: float, factor: float
) -> None:
    T_scan_design = shapes.motion(4)
    scan = scanned(T_scan_design)
    wrong = Mesh(scan.vertices / per_mm, scan.faces)
    design = save(shapes.bumpy_blob(4), tmp_path / "design.stl")
    result = register(design, save(wrong, tmp_path / "scan.ply"), settings=QUICK)
    assert result.verdict.status == "units_suspect"
    assert result.scale is not None and result.scale.unit_factor == pytest.approx(factor)
    assert result.transform is not None
    T = np.array(result.transform.matrix)
    assert rigid.rms_displacement(T, rigid.inverse(T_scan_design), scan.vertices) < 0.05
    placed = rigid.transformed(np.array(result.transform.matrix_file_to_file), wrong.vertices)
    np.testing.assert_allclose(placed, rigid.transformed(T, scan.vertices), atol=1e-3)


def test_saying_the_unit_settles_it(tmp_path: Path) -> None:
    scan = scanned(shapes.motion(4))
    path = save(Mesh(scan.vertices / 25.4, scan.faces), tmp_path / "scan.ply")
    design = save(shapes.bumpy_blob(4), tmp_path / "design.stl")
    result = register(design, MeshFile(path, unit="inch"), settings=QUICK)
    assert result.verdict.status == "ok" and result.scale is not None and result.scale.unit_factor is None


def test_a_mirrored_scan_is_told(tmp_path: Path) -> None:
    scan = scanned(shapes.motion(6))
    mirrored = Mesh(scan.vertices * [-1.0, 1, 1], scan.faces[:, ::-1])
    design = save(shapes.bumpy_blob(4), tmp_path / "design.stl")
    result = register(design, save(mirrored, tmp_path / "scan.ply"), settings=QUICK)
    assert result.verdict.status == "mirrored" and "mirrored" in codes(result)
    assert result.transform is None and result.verdict.confidence == 0.0
    assert all(np.linalg.det(np.array(pose.matrix)[:3, :3]) > 0 for pose in result.alternatives)


def dented(part: Mesh) -> Mesh:
    """The part with 3 mm of material missing in one place."""
    farthest = part.vertices[int(part.vertices[:, 2].argmax())]
    near = np.linalg.norm(part.vertices - farthest, axis=1) < 5.0
    return Mesh(part.vertices - 3.0 * near[:, None] * part.vertex_normals(), part.faces)


@pytest.mark.parametrize("kind", ["mirrored", pytest.param("inches", marks=pytest.mark.nightly)])
def test_neither_mirrored_nor_in_another_unit_where_material_is_missing_too(
    tmp_path: Path, kind: str
) -> None:
    """What `ok` would not accept of the scan itself does not accuse it either: at most a finding."""
    scan = noisy(dented(shapes.bumpy_blob(4, triangulation=2)), 6)
    changed = {
        "mirrored": Mesh(scan.vertices * [-1.0, 1, 1], scan.faces[:, ::-1]),
        "inches": Mesh(scan.vertices / 25.4, scan.faces),
    }[kind]
    design = save(shapes.bumpy_blob(4), tmp_path / "design.stl")
    result = register(design, save(changed, tmp_path / "scan.ply"), settings=QUICK)
    assert result.verdict.status in {"no_match", "ambiguous", "uncertain"}
    assert {"mirrored": "mirror_fits_better", "inches": "other_unit_fits"}[kind] in codes(result)
    assert not {"mirrored", "unit_factor"} & codes(result)


def test_an_exactly_symmetric_part_is_ok_with_its_other_poses(tmp_path: Path) -> None:
    part = cross(4)
    design, scan = save(part, tmp_path / "design.ply"), save(noisy(part, 3), tmp_path / "scan.ply")
    result = register(design, scan, settings=QUICK)
    assert result.verdict.status == "ok" and "symmetric_design" in codes(result)
    (row,) = [pose for pose in result.alternatives if pose.symmetry_of_design]  # one for all of them
    assert row.equivalent_poses == 3 and row.score == pytest.approx(1.0, abs=0.2)
    symmetry = result.symmetry
    assert symmetry is not None and (symmetry.kind, symmetry.order) == ("discrete", 4)
    (axis,) = symmetry.axes
    assert axis.order == 4
    np.testing.assert_allclose(np.abs(axis.axis), [0.0, 0.0, 1.0], atol=0.01)
    np.testing.assert_allclose(axis.point_mm[:2], 0.0, atol=0.1)
    for motion in symmetry.motions:  # each moves the design onto itself
        moved = rigid.transformed(np.array(motion), part.vertices)
        assert Surface(part).closest(moved).distance.max() < 0.1
    assert result.transform is not None
    turns = [shapes.motion(3) @ turned for turned in quarter_turns()]
    found = np.array(result.transform.matrix)
    apart = [rigid.rms_displacement(found, rigid.inverse(T), part.moved(T).vertices) for T in turns]
    assert min(apart) < 0.1


def quarter_turns() -> list[np.ndarray]:
    turns = []
    for k in range(4):
        T = np.eye(4)
        c, s = np.cos(k * np.pi / 2), np.sin(k * np.pi / 2)
        T[:2, :2] = [[c, -s], [s, c]]
        turns.append(T)
    return turns


def test_a_nearly_symmetric_part_is_not_called_symmetric(tmp_path: Path) -> None:
    """One lobe is 1.5 mm higher: the scan tells its pose, and the others are no symmetries."""
    part = cross(4, lift_mm=1.5)
    design, scan = save(part, tmp_path / "design.ply"), save(noisy(part, 3), tmp_path / "scan.ply")
    result = register(design, scan, settings=QUICK)
    assert result.verdict.status == "ok" and "symmetric_design" not in codes(result)
    assert result.transform is not None
    found, truth = np.array(result.transform.matrix), rigid.inverse(shapes.motion(3))
    assert rigid.rms_displacement(found, truth, part.moved(shapes.motion(3)).vertices) < 0.1


def test_the_part_of_the_scan_that_looks_alike_everywhere_is_ambiguous(tmp_path: Path) -> None:
    """The design has one odd lobe; the scan shows only two of the others: three places fit it."""
    part = cross(4, lift_mm=4.0)
    corners = part.vertices[part.faces]
    angle = np.arctan2(corners[:, :, 1], corners[:, :, 0])
    shown = (np.abs(angle) > np.pi / 4).all(axis=1) & (np.sign(angle[:, 0]) < 0)
    used = np.unique(part.faces[shown])
    piece = Mesh(part.vertices[used], np.searchsorted(used, part.faces[shown]))
    design, scan = save(part, tmp_path / "design.ply"), save(noisy(piece, 3), tmp_path / "scan.ply")
    result = register(design, scan, settings=QUICK)
    assert result.verdict.status == "ambiguous" and "rival_pose" in codes(result)
    assert result.transform is not None and len(result.alternatives) >= 1


@pytest.mark.parametrize(
    "shape", ["torus", *(pytest.param(name, marks=pytest.mark.nightly) for name in ("tube", "sphere"))]
)
def test_a_part_that_can_turn_is_under_constrained(tmp_path: Path, shape: str) -> None:
    made = {
        "torus": shapes.torus(),
        "tube": shapes.cylinder(6.0, 30.0, 64, 40),
        "sphere": shapes.icosphere(10.0, 4),
    }
    design = save(made[shape], tmp_path / "design.ply")
    result = register(design, save(noisy(made[shape], 2), tmp_path / "scan.ply"), settings=QUICK)
    assert result.verdict.status == "under_constrained"
    assert result.observability is not None and len(result.observability.free_motions) >= 1
    assert "free_motion" in codes(result) and result.transform is not None


def cut(scan: Mesh, kept: np.ndarray) -> Mesh:
    """The triangles all of whose corners are `kept` (n,)."""
    faces = scan.faces[kept[scan.faces].all(axis=1)]
    used = np.unique(faces)
    return Mesh(scan.vertices[used], np.searchsorted(used, faces))


def test_a_rack_lies_on_the_right_teeth(tmp_path: Path) -> None:
    part = shapes.rack()
    design, scan = save(part, tmp_path / "design.ply"), save(noisy(part, 5), tmp_path / "scan.ply")
    result = register(design, scan, settings=QUICK)
    assert result.verdict.status == "ok" and result.transform is not None
    found, truth = np.array(result.transform.matrix), rigid.inverse(shapes.motion(5))
    assert rigid.rms_displacement(found, truth, part.moved(shapes.motion(5)).vertices) < 0.1


def test_teeth_without_an_end_are_ambiguous_and_other_teeth_are_alternatives(tmp_path: Path) -> None:
    """A tooth on is 3.3 % of the diagonal: too near for two hypotheses, too far to be the same pose."""
    part = shapes.rack()
    middle = cut(part, (part.vertices[:, 0] > 20) & (part.vertices[:, 0] < 65) & (part.vertices[:, 2] > 2))
    of_middle = noisy(middle, 5)
    design, scan = save(part, tmp_path / "design.ply"), save(of_middle, tmp_path / "scan.ply")
    result = register(design, scan, settings=QUICK)
    assert result.verdict.status == "ambiguous" and result.transform is not None
    assert result.verdict.confidence is not None and result.verdict.confidence <= 0.5
    best, points = np.array(result.transform.matrix), middle.moved(shapes.motion(5)).vertices
    apart = [rigid.rms_displacement(np.array(each.matrix), best, points) for each in result.alternatives]
    assert apart and min(apart) > 1.0  # half a tooth off nothing fits
    assert result.alternatives[0].score < 1.25
    assert result.metrics.rmse_mm is not None
    for each in result.alternatives[:2]:  # over all vertices of the scan, as that of the best
        placed = rigid.transformed(np.array(each.matrix), of_middle.vertices)
        distance = Surface(part).closest(placed).distance
        expected = np.sqrt((of_middle.weights() * distance**2).sum())
        assert each.rmse_mm == pytest.approx(expected, rel=1e-4)
        assert each.rmse_mm >= 0.9 * result.metrics.rmse_mm


def test_matches_are_of_the_pose_that_is_given() -> None:
    """Whatever pose matching put first."""
    part = cross(4, lift_mm=1.5)
    design, job = design_of(part, QUICK), JobParameters(QUICK, 0, None)
    scan = analyse_mesh(noisy(part, 1), "scan", design.scales, QUICK, silent(), 0)
    matched = match_scan(scan, design, job)
    matching, length_mm = matched.matching, design.matching_mm
    turned = replace(
        matching.hypotheses[0], T_design_scan=quarter_turns()[1] @ matching.hypotheses[0].T_design_scan
    )
    hypotheses = (turned, *matching.hypotheses)
    wrong = match_landmarks(
        design.described.landmarks, scan.landmarks, hypotheses, turned.T_design_scan, length_mm
    )
    right, misled = (
        register_scan(MatchedScan(scan, matched.described, each), design, job).registration
        for each in (matching, wrong)
    )
    moved = rigid.transformed(misled.best.T_design_scan, scan.landmarks.position_mm[misled.matching.scan])
    residual_mm = np.linalg.norm(
        moved - design.described.landmarks.position_mm[misled.matching.design], axis=1
    )
    assert len(residual_mm) >= 3 and residual_mm.max() <= length_mm
    assert rigid.rms_displacement(misled.best.T_design_scan, right.best.T_design_scan, part.vertices) < 0.1
    assert misled.rmse_landmarks_mm == pytest.approx(right.rmse_landmarks_mm, rel=0.2)


@pytest.mark.nightly
def test_two_places_without_any_noise_are_ambiguous(tmp_path: Path) -> None:
    """What exact copies leave is rounding: its ratio says nothing."""
    part = shapes.rack()
    middle = cut(part, (part.vertices[:, 0] > 20) & (part.vertices[:, 0] < 65) & (part.vertices[:, 2] > 2))
    design = save(part, tmp_path / "design.ply")
    result = register(design, save(middle.moved(shapes.motion(3)), tmp_path / "scan.ply"), settings=QUICK)
    assert result.verdict.status == "ambiguous"


@pytest.mark.nightly
def test_a_bolt_in_inches_is_told_although_it_can_turn(tmp_path: Path) -> None:
    part = shapes.beads()
    scan = noisy(part, 2)
    design = save(part, tmp_path / "design.ply")
    inches = save(Mesh(scan.vertices / 25.4, scan.faces), tmp_path / "scan.ply")
    result = register(design, inches, settings=QUICK)
    assert result.verdict.status == "units_suspect" and "free_motion" in codes(result)


@pytest.mark.nightly
def test_another_part_is_no_match(tmp_path: Path) -> None:
    design = save(shapes.bumpy_blob(4), tmp_path / "design.ply")
    result = register(design, save(noisy(cross(5), 1), tmp_path / "scan.ply"), settings=QUICK)
    assert result.verdict.status == "no_match" and result.transform is None


@pytest.mark.parametrize(("share", "status"), [(0.04, "uncertain"), (0.002, "ok")])
def test_a_part_that_is_longer_than_its_design_is_not_ok(tmp_path: Path, share: float, status: str) -> None:
    """A crown is smooth: all of what is left of the distances looks like a warp."""
    part = catalogue.FAMILIES["crown"](5).mesh()
    longer = stretched(part, longest_axis(part), share)
    scan = structured_light(longer, 0.0005 * part.diagonal_mm, np.random.default_rng(0)).mesh
    design = save(part, tmp_path / "design.ply")
    result = register(design, save(scan, tmp_path / "scan.ply"), settings=QUICK)
    assert result.verdict.status == status
    assert ("stretched" in codes(result)) is (status == "uncertain")
    assert result.transform is not None and result.scale is not None and result.scale.per_axis is not None
    assert max(result.scale.per_axis) - 1 == pytest.approx(share, abs=0.003)
