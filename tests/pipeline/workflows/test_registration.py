"""The whole method: it recovers known motions, says no when there is no pose, and repeats to the byte."""

import csv
import json
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import trimesh

import pipeline
from pipeline import MeshFile, Progress, Settings
from pipeline.core.mesh import FloatArray, Mesh
from pipeline.kernels import rigid
from tests.support import shapes
from tests.support.closest_weights import closest_weights
from tests.support.registering import register
from tests.support.scans import NOISE_MM, save, scanned
from tests.support.settings import COARSE, FAST


def displacement_mm(result: pipeline.RegistrationResult, T_design_scan: FloatArray, scan: Mesh) -> float:
    assert result.transform is not None
    return rigid.rms_displacement(np.array(result.transform.matrix), T_design_scan, scan.vertices)


@pytest.fixture(scope="module")
def design(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return save(shapes.bumpy_blob(4), tmp_path_factory.mktemp("design") / "design.stl")


@pytest.fixture(scope="module")
def registered(
    design: Path, tmp_path_factory: pytest.TempPathFactory
) -> tuple[pipeline.RegistrationResult, Path]:
    """One job with its files: scan = T_scan_design @ design, so the pose to find is the inverse."""
    folder = tmp_path_factory.mktemp("job")
    scan = save(scanned(shapes.motion(11)), folder / "scan.ply")
    result = pipeline.register(design, scan, tolerance_mm=0.05, seed=3, out=folder / "out")
    return result, folder / "out"


@pytest.mark.parametrize(
    ("content", "files"),
    [
        ("light", {"results.json", "landmarks.csv", "aligned.ply", "deviation.ply"}),
        ("none", {"results.json"}),
    ],
)
def test_fewer_files_where_fewer_are_asked_for(
    content: str, files: set[str], design: Path, tmp_path: Path
) -> None:
    settings = Settings.model_validate(FAST | {"report": {"content": content}})
    scan = save(scanned(shapes.motion(11)), tmp_path / "scan.ply")
    result = pipeline.register(design, scan, settings=settings, out=tmp_path / "out")
    assert set(result.files) == {path.name for path in (tmp_path / "out").iterdir()} == files


def test_known_motion_is_recovered(registered: tuple[pipeline.RegistrationResult, Path]) -> None:
    result, _ = registered
    assert result.verdict.status == "ok"
    assert displacement_mm(result, rigid.inverse(shapes.motion(11)), shapes.bumpy_blob(3)) < 0.02
    assert result.transform is not None and result.transform.det == pytest.approx(1.0, abs=1e-12)
    assert result.scale is not None and result.scale.isotropic == pytest.approx(1.0, abs=1e-3)


def test_metrics_order_and_ratio(registered: tuple[pipeline.RegistrationResult, Path]) -> None:
    metrics = registered[0].metrics
    assert (
        metrics.rmse_mm is not None and metrics.rmse_landmarks_mm is not None and metrics.k_ratio is not None
    )
    assert metrics.rmse_mm < metrics.rmse_landmarks_mm < metrics.rmse_initial_mm
    assert metrics.k_ratio == pytest.approx(metrics.rmse_complete_mm / metrics.rmse_landmarks_mm)
    assert metrics.fitness == pytest.approx(1.0) and metrics.scan_overlap == pytest.approx(1.0)
    assert metrics.rmse_mm == pytest.approx(NOISE_MM, rel=0.5)


def test_rmse_is_what_the_files_say_by_another_route(
    registered: tuple[pipeline.RegistrationResult, Path],
) -> None:
    """aligned.ply against design.clean.ply, every triangle tried, area-weighted: no tree, no ray caster."""
    result, out = registered
    aligned = trimesh.load(out / "aligned.ply", process=False)
    clean = trimesh.load(out / "design.clean.ply", process=False)
    some = np.random.default_rng(0).choice(len(aligned.vertices), 60, replace=False)
    triangles = np.asarray(clean.triangles)
    nearest = []
    for point in np.asarray(aligned.vertices)[some]:
        weights = closest_weights(np.repeat(point[None], len(triangles), axis=0), triangles)
        nearest.append(np.linalg.norm(np.einsum("kc,kcd->kd", weights, triangles) - point, axis=1).min())
    scan = Mesh(aligned.vertices, aligned.faces)
    weights = scan.weights()[some]
    estimate = np.sqrt(weights @ np.square(nearest) / weights.sum())
    assert result.metrics.rmse_mm == pytest.approx(estimate, rel=0.25)  # 60 of 2562 vertices


def test_closed_design_deviation_is_the_rmse(registered: tuple[pipeline.RegistrationResult, Path]) -> None:
    result, _ = registered
    deviation = result.deviation
    assert deviation is not None and deviation.n == len(shapes.bumpy_blob(4).vertices)
    assert deviation.rms_mm == pytest.approx(result.metrics.rmse_mm, rel=1e-12)
    assert deviation.rms_mm**2 == pytest.approx(deviation.mean_mm**2 + deviation.sd_mm**2, rel=1e-9)
    assert deviation.within is not None and deviation.above is not None and deviation.below is not None
    assert deviation.within + deviation.above + deviation.below == pytest.approx(1.0)
    assert sum(part.n for part in deviation.by_segment) == deviation.n


def test_files_are_the_contract(registered: tuple[pipeline.RegistrationResult, Path]) -> None:
    result, out = registered
    assert sorted(path.name for path in out.iterdir()) == result.files
    assert set(result.files) == {
        *("results.json", "aligned.ply", "landmarks.csv", "report.html"),
        *("deviation.ply", "deviation.glb", "deviation_histogram.svg", "design.glb"),
        *("design.clean.ply", "design.vertices.csv", "design.decision_graph.svg"),
        *("scan.clean.ply", "scan.vertices.csv", "scan.decision_graph.svg"),
    }
    assert json.loads((out / "results.json").read_text()) == result.model_dump(mode="json")
    for mesh in ("design", "scan"):
        with (out / f"{mesh}.vertices.csv").open() as stream:
            rows = list(csv.DictReader(stream))
        clean = trimesh.load(out / f"{mesh}.clean.ply", process=False)
        assert list(rows[0]) == [
            "vertex",
            "x_mm",
            "y_mm",
            "z_mm",
            "segment",
            "halo",
            "rho",
            "delta",
            "t2",
            "landmark",
        ]
        xyz = np.array([[float(row[k]) for k in ("x_mm", "y_mm", "z_mm")] for row in rows])
        np.testing.assert_array_equal(xyz, clean.vertices)
        segments = getattr(result.segments, mesh)
        assert {int(row["segment"]) for row in rows} == set(range(segments.count))
        assert sum(centre.size for centre in segments.centres) == len(rows)
        marked = {int(row["vertex"]) for row in rows if row["landmark"] == "1"}
        assert marked == {landmark.vertex for landmark in getattr(result.landmarks, mesh)}
    with (out / "landmarks.csv").open() as stream:
        landmarks = list(csv.DictReader(stream))
    assert list(landmarks[0])[:6] == ["mesh", "id", "vertex", "x_mm", "y_mm", "z_mm"]
    matched = {
        (int(row["id"]), int(row["matched_to"]))
        for row in landmarks
        if row["mesh"] == "design" and row["matched_to"]
    }
    assert matched == {(match.design, match.scan) for match in result.landmarks.matches}


def test_matched_landmarks_lie_on_each_other(registered: tuple[pipeline.RegistrationResult, Path]) -> None:
    result, _ = registered
    assert len(result.landmarks.matches) >= 6
    radius_mm = 0.045 * np.sqrt(shapes.bumpy_blob(4).face_areas_mm2().sum())  # features.radius_share
    assert np.median([match.residual_mm for match in result.landmarks.matches]) < 0.6 * radius_mm


def test_swapping_design_and_scan_gives_the_inverse(
    design: Path, registered: tuple[pipeline.RegistrationResult, Path], tmp_path: Path
) -> None:
    result, _ = registered
    assert result.transform is not None
    scan = save(scanned(shapes.motion(11)), tmp_path / "scan.ply")
    back = pipeline.register(scan, design, settings=COARSE)
    T_scan_design = rigid.inverse(np.array(result.transform.matrix))
    assert displacement_mm(back, T_scan_design, shapes.bumpy_blob(3)) < 0.02


def test_the_other_unit_is_carried_by_the_file_to_file_matrix(design: Path, tmp_path: Path) -> None:
    in_mm = scanned(shapes.motion(4))
    scan = save(Mesh(in_mm.vertices / 25.4, in_mm.faces), tmp_path / "scan.ply")
    result = register(design, MeshFile(scan, unit="inch"), settings=COARSE)
    assert displacement_mm(result, rigid.inverse(shapes.motion(4)), in_mm) < 0.02
    assert result.transform is not None
    file_to_file = np.array(result.transform.matrix_file_to_file)
    expected = rigid.transformed(np.array(result.transform.matrix), in_mm.vertices)
    np.testing.assert_allclose(rigid.transformed(file_to_file, in_mm.vertices / 25.4), expected, atol=1e-9)
    assert result.provenance.inputs.scan.mm_per_unit == 25.4


def test_part_of_the_scan_is_enough(design: Path, tmp_path: Path) -> None:
    whole = scanned(np.eye(4))
    seen = (whole.vertices[whole.faces][:, :, 0] > -4).all(axis=1)
    part = Mesh(whole.vertices, whole.faces[seen]).moved(shapes.motion(6))
    result = register(design, save(part, tmp_path / "part.ply"))
    assert result.verdict.status == "ok"
    assert displacement_mm(result, rigid.inverse(shapes.motion(6)), whole) < 0.1
    assert result.metrics.design_coverage is not None and 0.4 < result.metrics.design_coverage < 0.8


def test_scan_turned_inside_out_finds_the_same_pose(design: Path, tmp_path: Path) -> None:
    """Open scans do not tell their outside; depth-camera meshes come either way."""
    whole = scanned(np.eye(4))
    seen = (whole.vertices[whole.faces][:, :, 0] > -4).all(axis=1)
    part = Mesh(whole.vertices, whole.faces[seen][:, ::-1]).moved(shapes.motion(6))
    result = register(design, save(part, tmp_path / "part.ply"), settings=COARSE)
    assert displacement_mm(result, rigid.inverse(shapes.motion(6)), whole) < 0.1


def test_scan_points_are_enough(design: Path, tmp_path: Path) -> None:
    whole = scanned(shapes.motion(8), levels=5)
    result = register(design, save(Mesh(whole.vertices), tmp_path / "scan.xyz"))
    assert result.verdict.status == "ok"
    assert displacement_mm(result, rigid.inverse(shapes.motion(8)), whole) < 0.05
    assert "point_cloud" in {note.code for note in result.warnings}


def test_another_part_is_no_match_and_never_the_identity(design: Path, tmp_path: Path) -> None:
    other = shapes.torus(14.0, 5.0)
    result = register(
        design,
        save(other.moved(shapes.motion(1)), tmp_path / "other.stl"),
        settings=COARSE,
        out=tmp_path / "out",
    )
    assert result.verdict.status == "no_match"
    assert result.transform is None and result.deviation is None
    assert result.metrics.rmse_mm is None and result.metrics.rmse_initial_mm > 0
    assert {"high_residual", "low_fitness"} & {finding.code for finding in result.verdict.findings}
    assert "aligned.ply" not in result.files and not (tmp_path / "out" / "aligned.ply").exists()
    assert len(result.alternatives) >= 1  # what was tried and rejected


def test_clean_input_gives_no_warnings(registered: tuple[pipeline.RegistrationResult, Path]) -> None:
    assert registered[0].warnings == []


def test_progress_names_every_stage_in_order_and_never_falls(design: Path, tmp_path: Path) -> None:
    heard: list[Progress] = []
    pipeline.register(
        design,
        design,
        settings=Settings.model_validate(FAST),
        out=tmp_path / "out",
        on_progress=heard.append,
    )
    assert {progress.stage for progress in heard} == set(pipeline.Stage) - {pipeline.Stage.STUDY}
    percents = [progress.percent for progress in heard]
    assert percents == sorted(percents) and percents[0] == 0 and percents[-1] <= 100
    both = [progress.message for progress in heard if progress.stage is pipeline.Stage.LOAD]
    assert both == ["load: design", "load: scan"]


def test_a_copy_registers_to_rounding_error(design: Path) -> None:
    result = register(design, design, settings=COARSE)
    assert result.metrics.rmse_mm == pytest.approx(0, abs=1e-6)
    assert result.transform is not None and result.transform.rotation_deg < 1e-5


def test_paper_preset_runs_on_the_files_own_vertices(design: Path, tmp_path: Path) -> None:
    scan = save(scanned(shapes.motion(2)), tmp_path / "scan.ply")
    result = pipeline.register(design, scan, settings=Settings.paper())
    assert displacement_mm(result, rigid.inverse(shapes.motion(2)), shapes.bumpy_blob(3)) < 0.02
    assert result.segments.design.density == "vertex"
    assert result.provenance.settings["features"]["kind"] == "integrated"


SCRIPT = """
import sys, pipeline
settings = pipeline.Settings.model_validate_json(sys.argv[4])
pipeline.register(*sys.argv[1:3], settings=settings, out=sys.argv[3], seed=5, tolerance_mm=0.1)
"""


def test_same_bytes_with_any_number_of_threads(design: Path, tmp_path: Path) -> None:
    scan = save(scanned(shapes.motion(9)), tmp_path / "scan.ply")
    settings = Settings.model_validate(FAST)
    folders = []
    for threads in ("1", "3"):
        folder = tmp_path / threads
        environment = os.environ | {"OMP_NUM_THREADS": threads, "OPENBLAS_NUM_THREADS": threads}
        subprocess.run(
            [sys.executable, "-c", SCRIPT, design, scan, folder, settings.model_dump_json()],
            check=True,
            env=environment,
        )
        folders.append(folder)
    one, three = folders
    for path in sorted(one.iterdir()):
        first, second = path.read_bytes(), (three / path.name).read_bytes()
        if path.name == "results.json":
            first, second = (
                json.dumps(json.loads(text) | {"timings_s": None}).encode() for text in (first, second)
            )
        assert first == second, path.name
