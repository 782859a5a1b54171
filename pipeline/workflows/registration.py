"""The story: a scan is registered to its design, stage by stage, as in the paper.

geodesic distances -> density-peak segments -> PCA + T^2 landmarks -> matching -> landmark-seeded ICP -> deviation
"""

from collections.abc import Callable
from pathlib import Path
from typing import TypeVar

from pipeline.analysis.design_model import fingerprint, kept_design
from pipeline.analysis.design_model import known as design_of
from pipeline.analysis.mesh_analysis import (
    Scales,
    analyse,
    cut,
    cut_record,
    landmark_records,
    read,
    segments_record,
    write_analysis,
)
from pipeline.api import MeshFile
from pipeline.core import timing as shares
from pipeline.core.progress import OnProgress, Stage
from pipeline.core.results import (
    Inputs,
    Landmarks,
    LandmarksOfMesh,
    LandmarksResult,
    RegistrationResult,
    SegmentsOfMesh,
    SegmentsPair,
    SegmentsResult,
    StudyResult,
)
from pipeline.core.settings import Settings
from pipeline.core.timing import StageTimer
from pipeline.report import artifacts as job_files
from pipeline.report import decision_graph, palette
from pipeline.report import writers as report
from pipeline.stages.deviation import deviation, deviation_of_design
from pipeline.studies.detector_study import study
from pipeline.verification import alternative_hypotheses as doubts
from pipeline.verification.alternative_hypotheses import Asked
from pipeline.verification.verdict import POSED, Case, judge
from pipeline.workflows import result_builders as records

R = TypeVar("R", RegistrationResult, SegmentsResult, LandmarksResult, StudyResult)


def run_registration(
    design_file: MeshFile,
    scan_file: MeshFile,
    *,
    settings: Settings,
    tolerance_mm: float | None,
    seed: int,
    out: Path | None,
    design_cache: Path | None,
    on_progress: OnProgress,
) -> RegistrationResult:
    """See `pipeline.register`."""
    watch = StageTimer(on_progress, shares.REGISTRATION)
    known = None if design_cache is None else kept_design(design_cache, design_file, settings, seed)
    is_new = known is None
    if known is None:
        design_read = read(design_file, "design", settings, watch, needs_surface=True)
        loaded_scan, clean_scan = read(scan_file, "scan", settings, watch, needs_surface=False)
        known = design_of(*design_read, fingerprint(design_file, settings, seed), settings, watch, seed)
    else:
        loaded_scan, clean_scan = read(scan_file, "scan", settings, watch, needs_surface=False)
    design = known.analysis
    scan = analyse(clean_scan.mesh, "scan", known.scales, settings, watch, seed)

    asked = Asked(settings, seed, tolerance_mm)
    with watch.stage(Stage.MATCHING, "scan"):
        side, matching = doubts.matched(scan, known, asked)
    with watch.stage(Stage.REGISTRATION):
        found = doubts.registered(scan, side, matching, known, asked)
        found, doubted = doubts.examined(found, known, asked)
        scan, registration = found.scan, found.registration
        marked = len(scan.landmarks.vertex)
        case = Case(
            registration, registration.matching, doubted, marked, known.diagonal_mm, asked.certain_mm(known)
        )
        verdict = judge(case, settings.registration)
    posed = verdict.status in POSED
    with watch.stage(Stage.DEVIATION):
        segment_of_face = design.segmentation.labels[
            design.resampled.working_of_clean[design.mesh.faces[:, 0]]
        ]
        measured = deviation(
            scan.mesh, known.surface, registration.fit, segment_of_face, tolerance_mm, settings.deviation
        )
        of_design = (
            deviation_of_design(
                scan.mesh,
                registration.scan_surface,
                known.surface,
                registration.fit,
                registration.inlier_distance_mm,
                tolerance_mm,
            )
            if posed
            else None
        )

    T_design_scan = registration.best.T_design_scan
    landmarks = Landmarks(
        design=landmark_records(design),
        scan=landmark_records(scan),
        matches=records.matches(registration.matching, design.landmarks, scan.landmarks, T_design_scan)
        if posed
        else [],
    )
    shown = scan.shown().moved(T_design_scan) if posed else scan.shown()
    files: list[str] = []
    if out is not None:
        with watch.stage(Stage.REPORT):
            out.mkdir(parents=True, exist_ok=True)
            if settings.report.write_files:
                files += known.write(out) + write_analysis(out, "scan", scan, settings)
                report.write_landmarks(
                    out / "landmarks.csv",
                    {"design": landmarks.design, "scan": landmarks.scan},
                    landmarks.matches,
                )
                files += ["landmarks.csv", job_files.PAGE]
                if posed:
                    report.write_mesh(out / "aligned.ply", shown.full)
                    files += ["aligned.ply", *job_files.write_deviation(out, shown, measured)]
            files.append("results.json")

    result = RegistrationResult(
        verdict=verdict,
        transform=records.transform(
            T_design_scan, known.kept.input.mm_per_unit, loaded_scan, doubted.unit_factor
        )
        if posed
        else None,
        alternatives=records.alternatives(registration, doubted.symmetric, rejected=not posed),
        metrics=records.metrics(registration, found=posed),
        landmarks=landmarks,
        segments=SegmentsPair(design=segments_record(design, settings), scan=segments_record(scan, settings)),
        deviation=measured.summary if posed else None,
        deviation_of_design=of_design,
        observability=records.observability(registration) if posed else None,
        scale=records.scale(registration, doubted.unit_factor) if posed else None,
        provenance=records.provenance(
            Inputs(
                design=known.kept.input,
                scan=records.input_record(loaded_scan, clean_scan),
            ),
            settings,
            seed,
        ),
        timings_s=watch.timings_s(),
        files=sorted(files),
        warnings=[
            *design.warnings,
            *scan.warnings,
            *records.landmark_warnings(design=landmarks.design, scan=landmarks.scan),
            *known.kept.notes,
            *records.input_warnings(scan=clean_scan),
        ],
    )
    result = _written(
        result,
        out,
        watch,
        lambda out, done: job_files.write_registration_page(
            out, done, known, scan, shown, measured, settings.report
        ),
    )
    if design_cache is not None and is_new:
        known.keep(design_cache)
    return result


def run_segments(
    file: MeshFile,
    *,
    settings: Settings,
    seed: int,
    out: Path | None,
    on_progress: OnProgress,
) -> SegmentsResult:
    """See `pipeline.find_segments`."""
    watch = StageTimer(on_progress, shares.SEGMENTS)
    loaded, cleaned = read(file, "mesh", settings, watch, needs_surface=True)
    mesh = cleaned.mesh
    found = cut(mesh, "mesh", Scales.of(mesh, settings), settings, watch, seed)
    segmentation, working_of_clean = found.segmentation, found.resampled.working_of_clean

    files: list[str] = []
    if out is not None:
        with watch.stage(Stage.REPORT):
            out.mkdir(parents=True, exist_ok=True)
            if settings.report.write_files:
                colours = palette.of_vertices(segmentation.labels, segmentation.halo)[working_of_clean]
                report.write_mesh(out / "mesh.segments.ply", mesh, colours)
                report.write_vertices(out / "mesh.vertices.csv", mesh, working_of_clean, segmentation)
                decision_graph.write(
                    out / "mesh.decision_graph.svg", "mesh", segmentation, settings.segmentation
                )
                files += ["mesh.segments.ply", "mesh.vertices.csv", "mesh.decision_graph.svg"]
            files.append("results.json")

    record = cut_record(mesh, found.resampled, segmentation, settings, limit_share=None)
    result = SegmentsResult(
        segments=SegmentsOfMesh(mesh=record),
        provenance=records.one_provenance(records.input_record(loaded, cleaned), settings, seed),
        timings_s=watch.timings_s(),
        files=sorted(files),
        warnings=[*found.distances.warnings, *records.input_warnings(mesh=cleaned)],
    )
    return _written(result, out, watch, None)


def run_landmarks(
    file: MeshFile,
    *,
    settings: Settings,
    seed: int,
    out: Path | None,
    on_progress: OnProgress,
) -> LandmarksResult:
    """See `pipeline.find_landmarks`."""
    watch = StageTimer(on_progress, shares.LANDMARKS)
    loaded, cleaned = read(file, "mesh", settings, watch, needs_surface=True)
    mesh = cleaned.mesh
    found = analyse(mesh, "mesh", Scales.of(mesh, settings), settings, watch, seed)
    marked = landmark_records(found)

    files: list[str] = []
    if out is not None:
        with watch.stage(Stage.REPORT):
            out.mkdir(parents=True, exist_ok=True)
            if settings.report.write_files:
                files = write_analysis(out, "mesh", found, settings)
                report.write_mesh(out / "mesh.segments.ply", mesh, found.segment_colours())
                report.write_landmarks(out / "landmarks.csv", {"mesh": marked})
                files += ["mesh.segments.ply", "landmarks.csv", job_files.PAGE]
            files.append("results.json")

    result = LandmarksResult(
        segments=SegmentsOfMesh(mesh=segments_record(found, settings)),
        landmarks=LandmarksOfMesh(mesh=marked),
        provenance=records.one_provenance(records.input_record(loaded, cleaned), settings, seed),
        timings_s=watch.timings_s(),
        files=sorted(files),
        warnings=[
            *found.warnings,
            *records.landmark_warnings(mesh=marked),
            *records.input_warnings(mesh=cleaned),
        ],
    )
    return _written(
        result,
        out,
        watch,
        lambda out, done: job_files.write_landmarks_page(out, done, found, settings.report),
    )


def run_study(
    file: MeshFile,
    *,
    settings: Settings,
    seed: int,
    out: Path | None,
    on_progress: OnProgress,
) -> StudyResult:
    """See `pipeline.study`."""
    watch = StageTimer(on_progress, shares.STUDY)
    loaded, cleaned = read(file, "mesh", settings, watch, needs_surface=True)
    with watch.stage(Stage.STUDY):
        found = study(
            cleaned.mesh, settings, seed, lambda share, what: watch.within(Stage.STUDY, share, what)
        )

    files: list[str] = []
    if out is not None:
        with watch.stage(Stage.REPORT):
            out.mkdir(parents=True, exist_ok=True)
            if settings.report.write_files:
                found.write(out)
                files = ["trials.csv", "study.svg", job_files.PAGE]
            files.append("results.json")

    result = StudyResult(
        protocol=found.protocol,
        informativeness=found.informativeness,
        repeatability=found.repeatability,
        summary=found.summary,
        provenance=records.one_provenance(records.input_record(loaded, cleaned), settings, seed),
        timings_s=watch.timings_s(),
        files=sorted(files),
        warnings=[*found.warnings, *records.input_warnings(mesh=cleaned)],
    )
    return _written(
        result, out, watch, lambda out, done: job_files.write_study_page(out, done, settings.report)
    )


def _written(
    result: R, out: Path | None, watch: StageTimer, write_page: Callable[[Path, R], job_files.Written] | None
) -> R:
    """The report, then results.json, with the report's own time in it, its further files and why one is not among them."""
    if out is None:
        return result
    if write_page is not None and job_files.PAGE in result.files:
        with watch.stage(Stage.REPORT):
            more: job_files.Written = write_page(out, result)
        result = result.model_copy(
            update={
                "timings_s": watch.timings_s(),
                "files": sorted([*result.files, *more.files]),
                "warnings": [*result.warnings, *more.notes],
            }
        )
    (out / "results.json").write_text(result.model_dump_json(indent=1) + "\n", encoding="utf-8")
    return result
