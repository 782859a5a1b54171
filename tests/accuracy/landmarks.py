"""Are landmarks found again, where do they lie, and how long do they take? `make bench` prints tables.

Repeatability as `pipeline/studies/repeatability.py` defines it: 20 points a detector, found again within 1 %
of the diagonal on an independent triangulation with noise of 0.1 % of the diagonal, whole and with 30 % cut
off; the registration error is that of the pose from the detector's points alone. Shapes in the first group
were looked at while the default was chosen; those in the second were not.
"""

import time
from collections import Counter
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from pathlib import Path
from typing import get_args

import numpy as np
from rich.console import Console
from rich.table import Table

import pipeline
from pipeline import Settings, StudySettings
from pipeline.analysis.mesh_analysis import Scales, segment_mesh
from pipeline.core.results import RepeatabilityRow
from pipeline.core.settings import Detector, LandmarksSettings
from pipeline.core.timing import silent
from pipeline.kernels.nearest import nearest
from pipeline.stages.features import features
from pipeline.studies.repeatability import repeatability, rows
from tests.accuracy.bench import read
from tests.accuracy.teeth import ARCHES, tooth_of_vertex
from tests.conftest import data_folder
from tests.support import shapes

TUNED_ON = (
    *("dental/arch_001C.ply", "dental/arch_013C.ply", "dental/arch_022C.ply", "dental/arch_h1.obj"),
    *("dental/molar_B03.obj", "dental/molar_H10.obj", "scans/stanford_bunny.obj", "scans/rocker_arm.obj"),
    *("scans/fertility.off", "cad/fandisk.obj", "cad/featuretype.stl", "cad/nist_am_artifact.stl"),
    "cad/so101_base.stl",
)
HELD_OUT = (
    *("dental/arch_012C.ply", "dental/molar_D09.obj", "dental/ofj_tooth_19.stl", "dental/cast_lower_a.obj"),
    *("cad/so101_upper_arm.stl", "cad/so101_mounting_plate.stl", "scans/foot.stl"),
)
DETECTORS: tuple[Detector, ...] = get_args(Detector)
TRIALS = 2


def of_shape(path: Path) -> list[RepeatabilityRow]:
    mesh = read(path)
    study = StudySettings(
        kind="repeatability", trials=TRIALS, noise_mm=0.001 * mesh.diagonal_mm, detectors=DETECTORS
    )
    _, trials = repeatability(mesh, Settings(study=study), 0, lambda _share, _what: None)
    return rows(trials, mesh.diagonal_mm)


def repeatabilities(console: Console, data: Path) -> None:
    paths = [data / name for name in (*TUNED_ON, *HELD_OUT)]
    with ProcessPoolExecutor(2, mp_context=get_context("spawn")) as pool:
        found: dict[Path, list[RepeatabilityRow]] = {}
        for path, its_rows in zip(paths, pool.map(of_shape, paths), strict=True):
            found[path] = its_rows
            console.print(path.stem, ", ".join(f"{row.detector} {row.mean:.2f}" for row in its_rows))
    for crop, words in ((False, "noise 0.1 %"), (True, "noise 0.1 %, 30 % cut off")):
        table = Table("shape", *DETECTORS, "chance", title=f"Repeatability at 1 % of the diagonal, {words}")
        for title, names in (("mean, looked at", TUNED_ON), ("mean, held out", HELD_OUT)):
            table_rows = {Path(name).stem: _of(found[data / name], crop) for name in names}
            for shape, of_detector in table_rows.items():
                table.add_row(shape, *_cells(of_detector, "mean"))
            means = [np.mean([each[d].mean for each in table_rows.values()]) for d in DETECTORS]
            chance = np.mean([row.chance for each in table_rows.values() for row in each.values()])
            table.add_row(
                title, *(f"{mean:.3f}" for mean in means), f"{chance:.2f}", style="bold", end_section=True
            )
        console.print(table)
        poses = Table(
            *("", *DETECTORS),
            title=f"From the detector's points alone, {words}: trials with a pose within 1 %, all shapes",
        )
        of_all = [_of(its_rows, crop) for its_rows in found.values()]
        poses.add_row(
            "right", *(f"{np.mean([each[d].pose_right for each in of_all]):.0%}" for d in DETECTORS)
        )
        console.print(poses)


def _of(found: list[RepeatabilityRow], crop: bool) -> dict[Detector, RepeatabilityRow]:
    return {row.detector: row for row in found if ("cut off" in row.condition) == crop}


def _cells(of_detector: dict[Detector, RepeatabilityRow], what: str) -> list[str]:
    chance = float(np.mean([row.chance for row in of_detector.values()]))
    return [*(f"{getattr(of_detector[d], what):.2f}" for d in DETECTORS), f"{chance:.2f}"]


def teeth(console: Console, data: Path) -> None:
    """Landmarks by tooth, and the bias of curvature maxima that the paper argues from: with as many
    points as T^2.
    """
    table = Table(
        *(
            "arch",
            "detector",
            "landmarks",
            "teeth with one",
            "on gum",
            "a molar or premolar",
            "a canine or incisor",
        ),
        *("least border distance, radii", "seconds"),
        title="Landmarks on labelled teeth; teeth 5 to 10 of each arch are canines and incisors",
    )
    for arch in ARCHES:
        path = data / "dental" / f"{arch}.ply"
        tooth = tooth_of_vertex(path)
        present = np.unique(tooth[tooth > 0])
        front = np.isin(present, np.arange(5, 11))
        for detector in ("t2", "gaussian_curvature"):
            settings = Settings(landmarks=LandmarksSettings(detector=detector))
            start = time.perf_counter()
            found = pipeline.find_landmarks(path, settings=settings)
            seconds = time.perf_counter() - start
            count = Counter(tooth[[mark.vertex for mark in found.landmarks.mesh]].tolist())
            on = np.array([count[t] for t in present])
            positions = np.array([mark.position_mm for mark in found.landmarks.mesh])
            table.add_row(
                *(arch, detector, str(len(positions)), f"{(on > 0).sum()} of {len(present)}", str(count[0])),
                *(
                    f"{on[~front].mean():.1f}",
                    f"{on[front].mean():.1f}",
                    f"{_border_radii(path, positions):.2f}",
                ),
                f"{seconds:.1f}",
            )
    console.print(table)


def _border_radii(path: Path, positions: np.ndarray) -> float:
    """Least distance along the surface from a landmark to the open border, in feature radii."""
    mesh, settings = read(path), Settings()
    scales = Scales.of(mesh, settings)
    resampled = segment_mesh(mesh, "mesh", scales, settings, silent(), 0, fine=True).resampled
    measured = features(resampled.fine or resampled.mesh, scales.radius_mm, settings.features)
    _, at = nearest(measured.mesh.vertices, positions)
    return float(measured.border_distance_mm[at].min() / scales.radius_mm)


def informativeness(console: Console, mesh_path: Path, trials: int) -> None:
    """The paper's protocol: seconds for one detector, and what comes out for all."""
    paper = Settings.paper()
    start = time.perf_counter()
    pipeline.study(mesh_path, kind="informativeness", trials=trials, detectors=["t2"], settings=paper)
    console.print(
        f"informativeness, {mesh_path.stem}, {trials} trials, t2: {time.perf_counter() - start:.0f} s"
    )
    found = pipeline.study(mesh_path, kind="informativeness", trials=1000, settings=paper)
    table = Table(
        *("detector", "ICP", "points", "K > 1 + 1e-6", "ties", "K >= 10", "K > 1, ties counted", "median K"),
        title=f"Informativeness, {mesh_path.stem}, 1000 trials, paper()",
    )
    for row in found.informativeness or []:
        median = "-" if row.k.p50 is None else f"{row.k.p50:.3g}"
        table.add_row(
            *(row.detector, row.icp, str(row.points), f"{row.share_above:.1%}", f"{row.share_tie:.1%}"),
            *(f"{row.share_at_least_10:.1%}", f"{row.share_raw_above:.1%}", median),
        )
    console.print(table)
    console.print(found.summary)


def main() -> None:
    console, data = Console(width=170), data_folder()
    pipeline.preload()
    if data is None:
        console.print("landmarks: CUSP_DATA is not set; the blob by formula only")
        blob = shapes.bumpy_blob(5)
        study = StudySettings(kind="repeatability", trials=TRIALS, noise_mm=0.001 * blob.diagonal_mm)
        _, trials = repeatability(blob, Settings(study=study), 0, lambda _share, _what: None)
        for row in rows(trials, blob.diagonal_mm):
            console.print(f"{row.condition}, {row.detector}: {row.mean:.2f} (chance {row.chance:.2f})")
        return
    teeth(console, data)
    repeatabilities(console, data)
    informativeness(console, data / "dental" / "arch_001C.ply", 10_000)


if __name__ == "__main__":
    main()
