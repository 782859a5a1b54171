"""Which descriptor finds a landmark again on the scan? `python -m tests.accuracy.descriptors`

Three, and two of them together, at the same landmarks, with the pipeline's own pairing behind each: FPFH
(Rusu et al. 2009); a signature of the features m, G and |l| averaged over four radii; the graph of geodesic
distances from a landmark to the centres of the segments, as a histogram. "first" and "of 8": share of the
scan's landmarks that have a counterpart (a landmark of the design within 1 % of the diagonal under the true
pose) whose counterpart is nearest by descriptor, or among the eight that matching tries. "pose": share of
scans for which a pair of such correspondences gives a pose within 5 % of the diagonal, from where ICP goes
on. Scans are those of the gauntlet, of seeds of their own.
"""

import time
from collections import defaultdict
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from multiprocessing import get_context

import numpy as np
from rich.console import Console
from rich.table import Table

import pipeline
from pipeline import Settings
from pipeline.analysis.mesh_analysis import Scales, segment_mesh
from pipeline.core.mesh import FloatArray, IndexArray, Mesh
from pipeline.core.timing import silent
from pipeline.kernels import poses, rigid
from pipeline.kernels.fpfh import fpfh
from pipeline.kernels.geodesics import GeodesicSolver
from pipeline.kernels.nearest import k_nearest, nearest
from pipeline.stages.features import features
from pipeline.stages.landmarks import LandmarkSet, landmarks
from tests.accuracy.bench import read
from tests.accuracy.gauntlet_scans import printed
from tests.accuracy.gauntlet_specs import CONDITIONS
from tests.accuracy.landmarks import HELD_OUT, TUNED_ON
from tests.conftest import data_folder
from tests.support import shapes

TESTED = ("scan", "crop 30 %", "rough")
RADII = (1.0, 1.6, 2.5, 4.0)  # times the features' own
BINS = 16  # of the geodesic histogram, up to 1.5 sqrt(area)
FOUND_SHARE, POSE_SHARE = 0.01, 0.05
FIRST_SEED = 100  # not those of the gauntlet


@dataclass(frozen=True, slots=True)
class Marked:
    """One mesh with landmarks; working : mesh; fine : that of the features; centres : (s,) working
    vertices
    """

    working: Mesh
    fine: Mesh
    marks: LandmarkSet
    centres: IndexArray
    surface: GeodesicSolver
    scales: Scales


def marked(mesh: Mesh, scales: Scales, settings: Settings) -> Marked:
    found = segment_mesh(mesh, "mesh", scales, settings, silent(), 0, fine=True)
    fine = found.resampled.fine or found.resampled.mesh
    measured = features(fine, scales.radius_mm, settings.features)
    marks = landmarks(
        found.resampled.mesh, found.distances.surface, found.segmentation, measured, settings.landmarks
    )
    return Marked(
        found.resampled.mesh, fine, marks, found.segmentation.centres, found.distances.surface, scales
    )


def by_fpfh(of: Marked, settings: Settings) -> FloatArray:
    support_mm = settings.matching.descriptor_radius_lengths * of.scales.matching_mm(settings)
    return fpfh(of.working, support_mm)[of.marks.vertex]


def by_features(of: Marked, settings: Settings) -> FloatArray:
    """(k, 12) m r, G r^2, |l| r at every radius r: pure numbers, each in units of its spread over the
    part.
    """
    _, at = nearest(of.fine.vertices, of.marks.position_mm)
    columns = []
    for radius_mm in of.scales.radius_mm * np.array(RADII):
        values = features(of.fine, radius_mm, settings.features).values
        for column in (
            radius_mm * values[:, 1],
            radius_mm**2 * values[:, 2],
            radius_mm * np.linalg.norm(values[:, 3:], axis=1),
        ):
            middle, spread = np.median(column), np.ptp(np.quantile(column, [0.1, 0.9]))
            columns.append(((column - middle) / max(float(spread), 1e-12))[at])
    return np.clip(np.stack(columns, axis=1), -5, 5)


def by_graph(of: Marked, settings: Settings) -> FloatArray:
    """(k, BINS) how many centres lie how far along the surface, smoothly binned."""
    del settings
    rows = of.surface.distances(of.centres)[:, of.marks.vertex].T / of.scales.size_mm
    middles = (np.arange(BINS) + 0.5) * 1.5 / BINS
    width = 1.5 / BINS
    near = np.exp(-0.5 * ((rows[:, :, None] - middles) / width) ** 2)
    return np.asarray(np.where(np.isfinite(rows)[:, :, None], near, 0.0).sum(axis=1), dtype=np.float64)


DESCRIPTORS: dict[str, Callable[[Marked, Settings], FloatArray]] = {
    "FPFH": by_fpfh,
    "features, 4 radii": by_features,
    "geodesic graph": by_graph,
}
TOGETHER = ("FPFH", "features, 4 radii")


@dataclass(frozen=True, slots=True)
class Found:
    """first, of_eight : shares, None without counterparts; pose : a pair gives a pose near the truth;
    seconds : both meshes
    """

    first: float | None
    of_eight: float | None
    pose: bool
    seconds: float


def trial(name: str, condition: str, seed: int) -> dict[str, Found]:
    data = data_folder()
    design = shapes.bumpy_blob(5) if name == "blob" or data is None else read(data / name)
    settings = Settings()
    scales = Scales.of(design, settings)
    made = printed(
        design,
        design.diagonal_mm,
        CONDITIONS[condition],
        np.random.default_rng([FIRST_SEED + seed, len(name)]),
    )
    ours, theirs = marked(design, scales, settings), marked(made.scan, scales, settings)
    described: dict[str, tuple[FloatArray, FloatArray, float]] = {}
    for word, describe in DESCRIPTORS.items():
        begun = time.perf_counter()
        described[word] = describe(ours, settings), describe(theirs, settings), time.perf_counter() - begun
    first, second = (described[word] for word in TOGETHER)
    both = [np.column_stack([_scaled(first[0], first[k]), _scaled(second[0], second[k])]) for k in (0, 1)]
    described[" + ".join(TOGETHER)] = both[0], both[1], first[2] + second[2]
    return {
        word: judged(
            of_design, of_scan, seconds, ours, theirs, made.T_design_scan, design.diagonal_mm, settings
        )
        for word, (of_design, of_scan, seconds) in described.items()
    }


def _scaled(of_design: FloatArray, values: FloatArray) -> FloatArray:
    """So that both parts of a pair count alike: the design's landmarks are at unit distance from their
    mean, RMS.
    """
    middle = of_design.mean(axis=0)
    return (values - middle) / max(float(np.sqrt(((of_design - middle) ** 2).sum(axis=1).mean())), 1e-12)


def judged(
    of_design: FloatArray,
    of_scan: FloatArray,
    seconds: float,
    ours: Marked,
    theirs: Marked,
    T_design_scan: FloatArray,
    diagonal_mm: float,
    settings: Settings,
) -> Found:
    if min(len(of_design), len(of_scan)) < 2:
        return Found(None, None, False, seconds)
    order = k_nearest(of_design, of_scan, min(settings.matching.candidates, len(of_design)))
    distance, counterpart = nearest(
        ours.marks.position_mm, rigid.transformed(T_design_scan, theirs.marks.position_mm)
    )
    there = distance <= FOUND_SHARE * diagonal_mm
    i, j = np.repeat(np.arange(len(order)), order.shape[1]), order.ravel()
    length_mm = ours.scales.matching_mm(settings)
    T = poses.from_oriented_pairs(
        (theirs.marks.position_mm[i], theirs.marks.normal[i]),
        (ours.marks.position_mm[j], ours.marks.normal[j]),
        length_tolerance_mm=1.5 * length_mm,
        min_length_mm=4 * length_mm,
        max_pairs=settings.matching.max_pairs,
    )
    probes = theirs.working.vertices[:: max(1, len(theirs.working.vertices) // 100)]
    apart = rigid.transformed(T, probes) - rigid.transformed(T_design_scan, probes)
    pose = bool((np.sqrt((apart**2).sum(axis=2).mean(axis=1)) <= POSE_SHARE * diagonal_mm).any())
    if not there.any():
        return Found(None, None, pose, seconds)
    hit = order[there] == counterpart[there, None]
    return Found(float(hit[:, 0].mean()), float(hit.any(axis=1).mean()), pose, seconds)


def table(found: dict[tuple[str, str], list[Found]], words: list[str]) -> Table:
    made = Table("condition", "scans", *words, title="first / of 8 / pose")
    for condition in TESTED:
        cells = []
        for word in words:
            rows = found[condition, word]
            first = np.mean([each.first for each in rows if each.first is not None])
            of_eight = np.mean([each.of_eight for each in rows if each.of_eight is not None])
            cells.append(f"{first:.2f} / {of_eight:.2f} / {np.mean([each.pose for each in rows]):.0%}")
        made.add_row(condition, str(len(found[condition, words[0]])), *cells)
    seconds = [
        f"{np.median([each.seconds for c in TESTED for each in found[c, word]]):.2f}" for word in words
    ]
    made.add_row("median s", "", *seconds)
    return made


def main() -> None:
    console = Console(width=150)
    names = ("blob",) if data_folder() is None else ("blob", *TUNED_ON, *HELD_OUT)
    tasks = [(name, condition, 0) for name in names for condition in TESTED]
    found: dict[tuple[str, str], list[Found]] = defaultdict(list)
    with ProcessPoolExecutor(2, mp_context=get_context("spawn"), initializer=pipeline.preload) as pool:
        for (name, condition, _), result in zip(
            tasks, pool.map(trial, *zip(*tasks, strict=True)), strict=True
        ):
            cells = ", ".join(
                f"{word} {each.first or 0:.2f} {each.of_eight or 0:.2f}" for word, each in result.items()
            )
            console.print(f"{name}, {condition}: {cells}", soft_wrap=True, highlight=False)
            for word, each in result.items():
                found[condition, word].append(each)
    console.print(table(found, list(dict.fromkeys(word for _, word in found))))


if __name__ == "__main__":
    main()
