"""The paper's study: the protocol's draws, closed forms, counts by hand, words and files."""

import csv
import re
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial import cKDTree

from pipeline.core.mesh import FloatArray, IndexArray
from pipeline.core.results import Quantiles, RepeatabilityProtocol, RepeatabilityRow
from pipeline.core.settings import Detector, StudySettings
from pipeline.kernels import rigid
from pipeline.studies import informativeness as study_module
from pipeline.studies import plots as study_plots
from pipeline.studies.informativeness import Informativeness, Registered, informativeness
from pipeline.studies.informativeness_summary import protocol, rows, summarize, write_trials
from tests.support import shapes

BLOB = shapes.bumpy_blob(3).vertices + np.array([100.0, -50.0, 20.0])
EVERY_TENTH: IndexArray = np.arange(0, len(BLOB), 10)


def studied(**changed: object) -> Informativeness:
    asked: dict[str, object] = {"trials": 40, "noise_mm": 2.0, "rotation_deg": 0.0, "seed": 0}
    asked |= changed
    return informativeness(BLOB, {"t2": EVERY_TENTH, "random": BLOB[5::20]}, **asked)  # type: ignore[arg-type]


def made(
    complete: list[float],
    ours: dict[Detector, list[float]],
    *,
    diagonal_mm: float = 100.0,
    rotation_deg: float = 0.0,
) -> Informativeness:
    """A study with these errors by either rule."""

    def registered(errors: list[float]) -> Registered:
        both = np.stack([np.array(errors)] * 2, axis=1)
        return Registered(20, both, np.ones(both.shape, dtype=np.int32), np.ones(len(both), dtype=np.bool_))

    trials = len(complete)
    return Informativeness(
        *(
            3.0,
            rotation_deg,
            diagonal_mm,
            np.zeros((trials, 3)),
            np.tile([0.0, 0, 1], (trials, 1)),
            np.zeros(trials),
        ),
        registered(complete),
        {detector: registered(errors) for detector, errors in ours.items()},
    )


def test_draws_fill_the_cube_and_the_ball_of_turns() -> None:
    study = informativeness(
        BLOB[::60], {"t2": np.arange(5)}, trials=4000, noise_mm=2.5, rotation_deg=30.0, seed=3
    )
    for axis in study.translation_mm.T:
        np.testing.assert_allclose(
            np.quantile(axis, [0, 0.25, 0.5, 0.75, 1]), [-2.5, -1.25, 0, 1.25, 2.5], atol=0.12
        )
    np.testing.assert_allclose(np.quantile(study.angle_deg, [0, 0.5, 1]), [0, 15, 30], atol=0.7)
    np.testing.assert_allclose(np.linalg.norm(study.axis, axis=1), 1.0, atol=1e-14)
    np.testing.assert_allclose(study.axis.mean(axis=0), 0.0, atol=0.04)
    np.testing.assert_allclose(study.axis.T @ study.axis / 4000, np.eye(3) / 3, atol=0.03)


def test_a_trial_is_the_five_steps_of_the_paper() -> None:
    """From the drawn numbers, with nothing of the kernel: the copy moved about the middle, both ICPs,
    errors of partners.
    """
    study = studied(trials=6, rotation_deg=40.0, noise_mm=4.0)
    middle = BLOB.mean(axis=0)

    def error_mm(points: FloatArray, start: FloatArray) -> float:
        tree, copy = cKDTree(points), rigid.transformed(start, points)
        back = np.eye(4)
        for _ in range(200):
            back = rigid.fit(copy, points[tree.query(rigid.transformed(back, copy))[1]])
        return rigid.rms_displacement(back @ start, np.eye(4), BLOB)

    for trial in range(6):
        turn = np.radians(study.angle_deg[trial]) * study.axis[trial]
        R = rigid.from_vector(np.concatenate([turn, np.zeros(3)])[None])[0, :3, :3]
        start = rigid.compose(R, middle - R @ middle + study.translation_mm[trial])
        found = study.complete.rmse_mm[trial, 1], study.landmarks["t2"].rmse_mm[trial, 1]
        np.testing.assert_allclose(
            found, [error_mm(BLOB, start), error_mm(BLOB[EVERY_TENTH], start)], atol=1e-9
        )


def test_small_shifts_are_undone_whatever_the_points_and_count_as_ties() -> None:
    spacing = cKDTree(BLOB).query(BLOB, k=2)[0][:, 1].min()
    study = studied(noise_mm=0.49 * spacing / np.sqrt(3))
    for row in rows(study):
        assert row.share_tie == 1.0
        assert row.share_above == row.share_at_least_10 == 0.0
        assert row.k.n == 0
        assert row.rmse_complete_mm.p95 is not None
        assert row.rmse_complete_mm.p95 < 1e-11
        assert 0.0 <= row.share_raw_above <= 1.0
    assert (study.complete.iterations == 1).all()
    words = summarize(protocol(study), rows(study))
    assert "every trial of every detector was a tie" in words
    assert "rounding errors" in words


def test_any_number_of_threads_gives_the_same_bits() -> None:
    one, many = (studied(trials=60, rotation_deg=20.0, threads=threads) for threads in (1, 4))
    np.testing.assert_array_equal(one.translation_mm, many.translation_mm)
    np.testing.assert_array_equal(one.complete.rmse_mm, many.complete.rmse_mm)
    for detector in one.landmarks:
        np.testing.assert_array_equal(one.landmarks[detector].rmse_mm, many.landmarks[detector].rmse_mm)


def test_a_short_study_is_the_start_of_a_long_one(monkeypatch: pytest.MonkeyPatch) -> None:
    long = studied(trials=30, rotation_deg=20.0)
    monkeypatch.setattr(study_module, "_CHUNK", 7)
    short = studied(trials=20, rotation_deg=20.0)
    np.testing.assert_array_equal(long.translation_mm[:20], short.translation_mm)
    np.testing.assert_array_equal(long.complete.rmse_mm[:20], short.complete.rmse_mm)
    np.testing.assert_array_equal(long.landmarks["random"].rmse_mm[:20], short.landmarks["random"].rmse_mm)


def test_another_seed_gives_other_trials() -> None:
    assert (studied(trials=5).translation_mm != studied(trials=5, seed=1).translation_mm).all()


def test_vertices_and_their_positions_are_the_same_landmarks() -> None:
    by_number = informativeness(BLOB, {"t2": EVERY_TENTH}, trials=5, noise_mm=2.0, rotation_deg=0.0, seed=0)
    by_place = informativeness(
        BLOB, {"t2": BLOB[EVERY_TENTH]}, trials=5, noise_mm=2.0, rotation_deg=0.0, seed=0
    )
    np.testing.assert_array_equal(by_number.landmarks["t2"].rmse_mm, by_place.landmarks["t2"].rmse_mm)


def test_progress_rises_to_one() -> None:
    heard: list[float] = []
    studied(trials=600, on_share=heard.append)
    assert heard == sorted(heard)
    assert len(heard) >= 9  # three sets of points, three chunks
    assert heard[-1] == 1.0


def test_fewer_than_three_points_are_refused() -> None:
    with pytest.raises(ValueError, match="iss has 2 points"):
        informativeness(BLOB, {"iss": np.array([0, 9])}, trials=1, noise_mm=1.0, rotation_deg=0.0, seed=0)


def test_counts_by_hand() -> None:
    # diagonal 100: errors below 1e-7 are rounding errors
    complete = [1.0, 1.0, 1.0, 1.0, 1e-13, 1e-13, 0.0, 1e-13, 2.0, 1.0]
    ours = [0.5, 2.0, 0.1, 1e-14, 1e-14, 1e-12, 0.0, 0.0, 0.0, 1.0]
    study = made(complete, {"t2": ours})
    first, second = rows(study)
    assert (first.icp, second.icp) == ("library", "converged")
    for row in (first, second):
        assert row.share_tie == pytest.approx(0.4)  # the fifth to the eighth
        assert row.share_above == pytest.approx(
            0.4
        )  # 2, 10, 1e14 and 2 / 0; not the last, where they are equal
        assert row.share_at_least_10 == pytest.approx(0.3)
        assert row.share_raw_above == pytest.approx(0.6)  # the four, and two of the ties
        assert row.k.n == 6
        assert row.k.p50 == pytest.approx(6.0)  # between 2 and 10
        assert row.rmse_complete_mm.n == row.rmse_landmarks_mm.n == 10
    k = study.k("t2")[:, 0]
    assert np.isfinite(k).all()
    np.testing.assert_allclose(k[:7], [2, 0.5, 10, 1e14, 10, 0.1, 1])
    assert k[7] > 1
    assert k[8] > 1e13


def test_words_compare_with_random_points() -> None:
    good, bad = [0.01] * 900 + [5.0] * 100, [0.01] * 500 + [5.0] * 500
    study = made([1.0] * 1000, {"t2": good, "iss": bad, "hks": bad, "random": bad})
    words = summarize(protocol(study), rows(study))
    assert "In 1,000 trials" in words
    assert "3 mm" in words
    assert "rotated" not in words
    assert "90.00 % (t2), 50.00 % (iss)" in words
    assert "more often than random points: t2; less often: none; within 3 standard errors: iss, hks" in words
    turned = made([1.0] * 4, {"t2": [2.0] * 4}, rotation_deg=12.0)
    words = summarize(protocol(turned), rows(turned))
    assert "rotated by up to 12 degrees" in words
    assert "random" not in words


def test_the_protocol_says_what_was_done() -> None:
    study = studied(trials=3, rotation_deg=5.0)
    said = protocol(study)
    assert (said.trials, said.noise_mm, said.rotation_deg) == (3, 2.0, 5.0)
    assert (said.points, said.count) == (len(BLOB), len(EVERY_TENTH))
    assert set(said.icp) == {"library", "converged"}
    assert "30 iterations" in said.icp["library"]
    assert said.tie == study_module.TIE


def test_the_table_has_a_row_a_trial_and_is_the_same_again(tmp_path: Path) -> None:
    study = studied(trials=25, rotation_deg=15.0)
    for name in ("a.csv", "b.csv"):
        write_trials(tmp_path / name, study)
    assert (tmp_path / "a.csv").read_bytes() == (tmp_path / "b.csv").read_bytes()
    with (tmp_path / "a.csv").open(newline="") as stream:
        table = list(csv.DictReader(stream))
    assert [int(row["trial"]) for row in table] == list(range(25))
    np.testing.assert_array_equal([float(row["dy_mm"]) for row in table], study.translation_mm[:, 1])
    np.testing.assert_array_equal([float(row["angle_deg"]) for row in table], study.angle_deg)
    for rule, name in enumerate(("library", "converged")):
        complete = [float(row[f"{name}_rmse_complete_mm"]) for row in table]
        np.testing.assert_array_equal(complete, study.complete.rmse_mm[:, rule])
        for detector, found in study.landmarks.items():
            ours = [float(row[f"{name}_{detector}_rmse_landmarks_mm"]) for row in table]
            np.testing.assert_array_equal(ours, found.rmse_mm[:, rule])
            k = [float(row[f"{name}_{detector}_k"]) for row in table]
            np.testing.assert_array_equal(k, study.k(detector)[:, rule])


@pytest.mark.parametrize("rotation_deg", [0.0, 60.0], ids=["all ties", "some ties"])
def test_the_picture_has_every_curve_and_is_the_same_again(tmp_path: Path, rotation_deg: float) -> None:
    study = studied(rotation_deg=rotation_deg)
    for name in ("a.svg", "b.svg"):
        study_plots.write_informativeness(tmp_path / name, study)
    drawn = (tmp_path / "a.svg").read_text()
    assert drawn.encode() == (tmp_path / "b.svg").read_bytes()
    assert set(re.findall(r'id="(k-[a-z0-9-]+)"', drawn)) == {
        f"k-{rule}-{detector}" for rule in ("library", "converged") for detector in study.landmarks
    }
    assert "dc:date" not in drawn


def test_a_picture_of_no_error_at_all_can_be_drawn(tmp_path: Path) -> None:
    study_plots.write_informativeness(
        tmp_path / "s.svg", made([0.0, 5.0], {"t2": [3.0, 0.0], "gp": [0.0, 1.0]})
    )


def test_repeatability_is_drawn_for_every_condition_and_detector(tmp_path: Path) -> None:
    nothing = Quantiles(n=0, p05=None, p25=None, p50=None, p75=None, p95=None)
    conditions = ["noise 0.1%", "noise 0.1%, 30% cut off"]
    asked = RepeatabilityProtocol(
        trials=5, eps=0.01, eps_mm=0.8, count=20, spacing_mm=2.0, conditions=conditions
    )
    found = [
        RepeatabilityRow(
            detector=detector,
            condition=condition,
            repeatability=nothing,
            mean=0.1 * number,
            chance=0.05,
            points=20.0,
            pose_error_mm=nothing,
            pose_right=0.5,
        )
        for condition in conditions
        for number, detector in enumerate(StudySettings().detectors)
    ]
    for name in ("a.svg", "b.svg"):
        study_plots.write_repeatability(tmp_path / name, asked, found)
    drawn = (tmp_path / "a.svg").read_text()
    assert drawn.encode() == (tmp_path / "b.svg").read_bytes()
    assert drawn.count('id="mean-') == len(found)
