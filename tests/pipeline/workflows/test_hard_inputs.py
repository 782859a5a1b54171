"""Meshes that no one should send, but someone does: a verdict or a clear error, never an exception text,
never the identity as an answer.
"""

from pathlib import Path

import numpy as np
import pytest
import trimesh

import pipeline
from pipeline import PipelineError
from pipeline.core.mesh import Mesh
from pipeline.kernels import rigid
from tests.support import shapes
from tests.support.registering import register
from tests.support.scans import save, scanned
from tests.support.settings import COARSE as QUICK

POSE = shapes.motion(8)


@pytest.fixture(scope="module")
def design(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return save(shapes.bumpy_blob(4), tmp_path_factory.mktemp("design") / "design.stl")


def registered(design: Path, scan: Mesh, tmp_path: Path) -> pipeline.RegistrationResult:
    return register(
        design, save(scan, tmp_path / ("scan.xyz" if scan.is_cloud else "scan.ply")), settings=QUICK
    )


def error_mm(result: pipeline.RegistrationResult) -> float:
    assert result.transform is not None
    points = shapes.bumpy_blob(3).moved(POSE).vertices
    return rigid.rms_displacement(np.array(result.transform.matrix), rigid.inverse(POSE), points)


def test_fifty_points_are_a_verdict_or_a_clear_error(design: Path, tmp_path: Path) -> None:
    few = scanned(POSE).vertices[::52]
    assert len(few) == 50
    try:
        result = registered(design, Mesh(few), tmp_path)
    except PipelineError as error:
        assert error.mesh == "scan" and error.remedy
    else:
        assert result.verdict.status != "ok" or error_mm(result) < 0.6


def test_a_hundred_shells(design: Path, tmp_path: Path) -> None:
    """The part in a hundred separate pieces, as some exports have it, is still the part."""
    scan = scanned(POSE, levels=4)
    corners = scan.vertices[scan.faces].mean(axis=1)
    seeds = corners[np.linspace(0, len(corners) - 1, 100).astype(int)]
    piece = ((corners[:, None] - seeds[None]) ** 2).sum(axis=2).argmin(axis=1)
    vertices, faces = [], []
    for number in range(100):
        own = scan.faces[piece == number]
        used, local = np.unique(own, return_inverse=True)
        faces.append(local.reshape(-1, 3) + sum(map(len, vertices)))
        # pulled in by a hair, so that the borders are not welded again
        vertices.append(scan.vertices[used] + 1e-3 * (scan.vertices[used].mean(axis=0) - scan.vertices[used]))
    result = registered(design, Mesh(np.concatenate(vertices), np.concatenate(faces)), tmp_path)
    assert result.verdict.status != "ok" or error_mm(result) < 0.2


@pytest.mark.nightly
def test_a_scan_that_overlaps_nowhere_is_no_match(design: Path, tmp_path: Path) -> None:
    plate = shapes.box((60.0, 40.0, 1.0), levels=4)
    result = registered(design, plate.moved(POSE), tmp_path)
    assert result.verdict.status == "no_match" and result.transform is None


@pytest.mark.nightly
def test_duplicated_faces(design: Path, tmp_path: Path) -> None:
    scan = scanned(POSE)
    result = registered(design, Mesh(scan.vertices, np.concatenate([scan.faces, scan.faces[:500]])), tmp_path)
    assert result.verdict.status == "ok" and error_mm(result) < 0.1


def test_inward_normals(design: Path, tmp_path: Path) -> None:
    scan = scanned(POSE)
    result = registered(design, Mesh(scan.vertices, scan.faces[:, ::-1]), tmp_path)
    assert result.verdict.status == "ok" and error_mm(result) < 0.1


def test_a_scan_of_the_inside(tmp_path: Path) -> None:
    """A hollow part, of which only the wall inside was scanned: the place is inside, or it cannot be told."""
    outer, inner = shapes.bumpy_blob(3), shapes.bumpy_blob(3)
    small = Mesh(inner.vertices * 0.85, inner.faces[:, ::-1])
    hollow = Mesh(
        np.concatenate([outer.vertices, small.vertices]),
        np.concatenate([outer.faces, small.faces + len(outer.vertices)]),
    )
    design = save(hollow, tmp_path / "hollow.ply")
    result = register(design, save(small.moved(POSE), tmp_path / "scan.ply"), settings=QUICK)
    assert result.verdict.status != "ok" or error_mm(result) < 0.1


def test_the_identity_is_never_the_answer_to_could_not(design: Path, tmp_path: Path) -> None:
    rng = np.random.default_rng(0)
    dust = Mesh(rng.normal(0, 10, (1000, 3)))
    try:
        result = registered(design, dust, tmp_path)
    except PipelineError as error:
        assert error.reason and error.remedy
    else:
        assert result.verdict.status == "no_match" and result.transform is None


def test_a_cad_box_sent_as_its_own_scan_holds_still(tmp_path: Path) -> None:
    """Its eight vertices lie at corners, whose normals say little; its surface says all."""
    box = trimesh.creation.box((10.0, 20.0, 30.0))
    file = save(Mesh(box.vertices, box.faces), tmp_path / "box.stl")
    result = register(file, file, settings=QUICK)
    assert result.verdict.status == "ok"
    assert result.observability is not None
    assert result.observability.free_motions == []
