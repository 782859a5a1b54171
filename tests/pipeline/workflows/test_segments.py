"""`find_segments` on three beads on a rod: what it records and writes, and how each clustering cuts them.

Density peaks are not asked for the beads: a sphere is as dense everywhere, and densest where it meets the
rod.
"""

import csv
import json
from pathlib import Path

import numpy as np
import pytest
import trimesh

from pipeline import MeshFile, Progress, Settings, Stage, find_segments
from pipeline.core.errors import EmptyFile, NoSurface
from pipeline.kernels.clusterings import METHODS
from pipeline.report import palette
from tests.support import shapes

PITCH_MM = 24.0  # farther apart than the 10 mm they measure: then even farthest points must tell them apart
QUICK = {"resample": {"target_vertices": 900}}


def quick(**segmentation: object) -> Settings:
    return Settings.model_validate({**QUICK, "segmentation": segmentation})


def bead_of(
    xyz: np.ndarray[tuple[int, ...], np.dtype[np.float64]],
) -> np.ndarray[tuple[int, ...], np.dtype[np.int64]]:
    """Which bead each point is on, -1 on the rod between."""
    number = np.clip(np.round(xyz[:, 0] / PITCH_MM), 0, 2).astype(np.int64)
    return np.where(np.abs(xyz[:, 0] - PITCH_MM * number) < 4.5, number, -1)


@pytest.fixture(scope="module")
def beads(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("mesh") / "beads.ply"
    solid = shapes.beads(pitch_mm=PITCH_MM)
    trimesh.Trimesh(solid.vertices, solid.faces, process=False).export(path)
    return path


def test_the_beads_are_a_closed_solid_with_outward_faces() -> None:
    solid = shapes.beads()
    made = trimesh.Trimesh(solid.vertices, solid.faces, process=False)
    assert made.is_watertight and made.volume > 0


@pytest.mark.parametrize("method", sorted(METHODS))
def test_every_bead_is_one_segment_of_a_clustering(method: str, beads: Path, tmp_path: Path) -> None:
    result = find_segments(beads, settings=quick(method=method, n_centres=3), out=tmp_path)
    segments = result.segments.mesh
    assert (segments.count, segments.method, segments.limit_share) == (3, method, None)
    assert segments.halo_fraction == 0
    with (tmp_path / "mesh.vertices.csv").open() as stream:
        rows = list(csv.DictReader(stream))
    xyz = np.array([[float(row[k]) for k in ("x_mm", "y_mm", "z_mm")] for row in rows])
    label, bead = np.array([int(row["segment"]) for row in rows]), bead_of(xyz)
    most = [np.bincount(label[bead == k]).argmax() for k in range(3)]
    assert sorted(most) == [0, 1, 2]
    np.testing.assert_array_equal(label[bead >= 0], np.array(most)[bead[bead >= 0]])
    assert sum(centre.size for centre in segments.centres) == len(rows)


def test_without_a_number_other_methods_take_that_of_density_peaks(beads: Path) -> None:
    peaks, means = (
        find_segments(beads, settings=quick(method=method)).segments.mesh for method in ("cfsfdp", "kmeans")
    )
    assert means.count == peaks.count
    assert means.d_c == peaks.d_c


def test_files_are_what_the_record_says(beads: Path, tmp_path: Path) -> None:
    settings = quick(n_centres=3)
    result = find_segments(MeshFile(beads, unit="cm"), settings=settings, out=tmp_path / "once", seed=4)
    assert result.files == [
        "mesh.decision_graph.svg",
        "mesh.segments.ply",
        "mesh.vertices.csv",
        "results.json",
    ]
    assert sorted(path.name for path in (tmp_path / "once").iterdir()) == result.files
    told = json.loads((tmp_path / "once" / "results.json").read_text())
    assert told == result.model_dump(mode="json")
    assert (told["schema_version"], told["type"], list(told["segments"])) == ("1", "segments", ["mesh"])
    mesh = told["provenance"]["inputs"]["mesh"]
    assert (mesh["unit"], mesh["mm_per_unit"]) == ("cm", 10.0)
    assert told["provenance"]["seed"] == 4
    assert told["provenance"]["settings"] == settings.model_dump(mode="json")
    with (tmp_path / "once" / "mesh.vertices.csv").open() as stream:
        rows = list(csv.DictReader(stream))
    painted = trimesh.load(tmp_path / "once" / "mesh.segments.ply", process=False)
    xyz = np.array([[float(row[k]) for k in ("x_mm", "y_mm", "z_mm")] for row in rows])
    np.testing.assert_array_equal(xyz, painted.vertices)
    np.testing.assert_allclose(np.ptp(xyz, axis=0)[0], 580.0)  # 58 units of a centimetre
    colours = palette.of_vertices(
        np.array([int(row["segment"]) for row in rows], dtype=np.int32),
        np.array([row["halo"] == "1" for row in rows]),
    )
    assert np.abs(painted.visual.vertex_colors[:, :3] / 255 - colours).max() < 0.01
    assert {(row["t2"], row["landmark"]) for row in rows} == {("0.0", "0")}

    find_segments(MeshFile(beads, unit="cm"), settings=settings, out=tmp_path / "again", seed=4)
    for name in result.files[:-1]:
        assert (tmp_path / "once" / name).read_bytes() == (tmp_path / "again" / name).read_bytes()


def test_progress_names_the_stages_and_never_falls(beads: Path, tmp_path: Path) -> None:
    heard: list[Progress] = []
    result = find_segments(beads, settings=quick(), out=tmp_path, on_progress=heard.append)
    expected = [Stage.LOAD, Stage.CLEAN, Stage.RESAMPLE, Stage.GEODESICS, Stage.SEGMENTATION, Stage.REPORT]
    assert [step.stage for step in heard] == expected
    percents = [step.percent for step in heard]
    assert percents == sorted(percents) and percents[0] == 0 and 50 < percents[-1] <= 100
    assert list(result.timings_s) == [stage.value for stage in expected]


def test_points_without_triangles_are_refused(tmp_path: Path) -> None:
    """Nothing says at which scale to look at them; in a registration the design does."""
    cloud = tmp_path / "cloud.xyz"
    np.savetxt(cloud, shapes.icosphere(10.0).vertices, fmt="%.9g")
    with pytest.raises(NoSurface, match=r"^mesh: "):
        find_segments(cloud)


def test_a_bad_file_is_named_mesh(tmp_path: Path) -> None:
    empty = tmp_path / "empty.stl"
    empty.touch()
    with pytest.raises(EmptyFile, match=r"^mesh: "):
        find_segments(empty)
