"""Studies count what they say they count, and the same input gives the same bytes."""

import csv
from pathlib import Path

import numpy as np
import pytest

import pipeline
from pipeline import Settings
from pipeline.core.errors import TooFewLandmarks
from pipeline.core.mesh import FloatArray, Mesh
from pipeline.core.settings import FeaturesSettings, ResampleSettings, SegmentationSettings
from pipeline.kernels import rigid
from pipeline.kernels.surface import Surface
from pipeline.studies.repeatability import pairs_within, repeatability, rows
from pipeline.studies.simulated_scan import Condition, simulate_scan
from tests.support import shapes
from tests.support.scans import save

QUICK = Settings(
    resample=ResampleSettings(target_vertices=1500), features=FeaturesSettings(target_vertices=3000)
)


@pytest.fixture(scope="module")
def blob(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return save(shapes.bumpy_blob(4), tmp_path_factory.mktemp("blob") / "blob.ply")


def test_pairs_are_one_to_one_and_as_many_as_possible() -> None:
    def line(*x: float) -> FloatArray:
        return np.column_stack([x, np.zeros((len(x), 2))])

    assert pairs_within(line(0, 10), line(0.5, 9.5), 1.0) == 2
    assert pairs_within(line(0, 0.8), line(0.4), 1.0) == 1  # two claim one
    assert pairs_within(line(0, 1), line(0.9, -0.9), 1.0) == 2  # the nearest pair first would leave one
    assert pairs_within(line(), line(1.0), 1.0) == 0


@pytest.mark.parametrize("crop", [0.0, 0.3])
def test_a_scan_is_the_shape_moved_with_its_noise_and_crop(crop: float) -> None:
    blob = shapes.bumpy_blob(4)
    scan, seen, T_scan_design = simulate_scan(blob, Condition("", 0.001, crop), np.random.default_rng(0))
    back = scan.moved(rigid.inverse(T_scan_design))
    distance = Surface(blob).closest(back.vertices).distance
    assert np.sqrt((distance**2).mean()) == pytest.approx(0.001 * blob.diagonal_mm, rel=0.2)
    assert seen(back.vertices).mean() > 0.98
    area = float(np.average(seen(blob.vertices), weights=blob.vertex_areas_mm2()))
    assert area == pytest.approx(1 - crop, abs=0.03)


def test_repeatability_of_the_blob(blob: Path, tmp_path: Path) -> None:
    found = pipeline.study(
        blob, kind="repeatability", trials=1, detectors=["t2", "random"], settings=QUICK, out=tmp_path
    )
    assert found.repeatability is not None and found.informativeness is None
    first = {row.detector: row for row in found.repeatability if row.condition == "noise 0.1%"}
    assert first["t2"].mean >= 0.5 > 0.3 >= first["random"].mean
    assert first["t2"].chance == first["random"].chance < 0.15
    assert first["t2"].pose_right == 1.0
    assert (
        sorted(path.name for path in tmp_path.iterdir())
        == found.files
        == ["report.html", "results.json", "study.svg", "trials.csv"]
    )
    with (tmp_path / "trials.csv").open() as stream:
        table = list(csv.DictReader(stream))
    assert len(table) == 3 * 2  # conditions, detectors
    assert "Repeatability of" in found.summary


def test_abstention_is_a_miss() -> None:
    """More points are asked for than the detector gives: what it gives is counted over what was asked."""
    sphere_with_one_bump = shapes.icosphere(10.0, 4)
    n = sphere_with_one_bump.vertices / 10.0
    height = 1 + 0.4 * np.exp(-(1 - n[:, 2]) / 0.02)
    mesh = Mesh(10 * height[:, None] * n, sphere_with_one_bump.faces)
    settings = QUICK.model_copy(
        update={
            "study": QUICK.study.model_copy(
                update={
                    "kind": "repeatability",
                    "trials": 1,
                    "detectors": ("t2",),
                    "count": 40,
                    "noise_mm": 0.01,
                }
            ),
            "segmentation": SegmentationSettings(n_centres=4),
        }
    )
    _, trials = repeatability(mesh, settings, 0, lambda _share, _what: None)
    row = rows(trials, mesh.diagonal_mm)[0]
    assert row.points < 40
    assert row.mean <= row.points / 40 + 1e-9


def test_informativeness_of_the_blob(blob: Path, tmp_path: Path) -> None:
    shares: list[float] = []
    found = pipeline.study(
        blob,
        trials=40,
        detectors=["t2", "random"],
        settings=QUICK,
        seed=4,
        out=tmp_path,
        on_progress=lambda step: shares.append(step.percent),
    )
    assert found.informativeness is not None and found.protocol.kind == "informativeness"
    assert {(row.detector, row.icp) for row in found.informativeness} == {
        (detector, icp) for detector in ("t2", "random") for icp in ("library", "converged")
    }
    assert found.protocol.trials == 40 and shares == sorted(shares)
    again = pipeline.study(
        blob, trials=40, detectors=["t2", "random"], settings=QUICK, seed=4, out=tmp_path / "again"
    )
    assert again.informativeness == found.informativeness
    for name in ("trials.csv", "study.svg", "report.html"):
        assert (tmp_path / name).read_bytes() == (tmp_path / "again" / name).read_bytes()


def test_a_shape_without_relief_is_refused_with_a_reason(tmp_path: Path) -> None:
    sphere = save(shapes.icosphere(10.0, 3), tmp_path / "sphere.ply")
    with pytest.raises(TooFewLandmarks, match="no detector found 3 points"):
        pipeline.study(sphere, trials=5, detectors=["t2"], settings=QUICK)


def test_paper_study_says_that_it_took_the_halo_in(blob: Path) -> None:
    found = pipeline.study(blob, trials=5, detectors=["t2"], settings=Settings.paper())
    assert found.protocol.kind == "informativeness" and found.protocol.noise_mm == 2.5
    row = (found.informativeness or [])[0]
    assert row.points >= 3
