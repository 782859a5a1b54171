"""Registration: a scan is registered to its design, stage by stage, as in the paper.

geodesic distances -> density-peak segments -> PCA + T^2 landmarks -> matching -> landmark-seeded ICP ->
deviation

Three steps: compute (`compute_registration`), build the result (`registration_result`), write the files
(`publish`).
"""

from pathlib import Path

from pipeline.analysis.design_model import DesignModel, build_design, fingerprint, load_design
from pipeline.analysis.inputs import read_mesh
from pipeline.analysis.mesh_analysis import analyse_mesh
from pipeline.analysis.scan_registration import RegisteredScan, match_scan
from pipeline.core import timing
from pipeline.core.job_parameters import JobParameters
from pipeline.core.mesh_file import MeshFile
from pipeline.core.progress import OnProgress, Stage
from pipeline.core.results import DesignDeviation, RegistrationResult
from pipeline.core.settings import Settings
from pipeline.core.timing import StageTimer
from pipeline.inspection import qdas
from pipeline.inspection.alignment import Aligned, align
from pipeline.inspection.inspect import inspect, without_pose
from pipeline.inspection.places import check_places
from pipeline.report.artifacts import Artifacts, write_registration
from pipeline.stages.deviation import Deviations, deviation, deviation_of_design
from pipeline.stages.registration import Registration
from pipeline.stages.scale import ScaleDiagnosis, diagnose_scale
from pipeline.stages.strays import without_oversize
from pipeline.stages.table import without_table
from pipeline.verification.verdict import HAS_POSE
from pipeline.workflows.alternative_records import listed_alternatives
from pipeline.workflows.judged_pose import judged_pose
from pipeline.workflows.publish import publish
from pipeline.workflows.registration_outcome import RegistrationOutcome
from pipeline.workflows.result_builders import registration_result


def run_registration(
    design_file: MeshFile,
    scan_file: MeshFile,
    job: JobParameters,
    *,
    out: Path | None,
    design_cache: Path | None,
    on_progress: OnProgress,
) -> RegistrationResult:
    """See `pipeline.register`."""
    timer, settings = StageTimer(on_progress, timing.REGISTRATION), job.settings
    design = None if design_cache is None else load_design(design_cache, design_file, settings, job.seed)
    had_files = design is not None and bool(design.cached.files)
    outcome = compute_registration(design_file, scan_file, design, job, timer)
    result = registration_result(outcome, job)
    is_new, design = design is None, outcome.design
    written = (design, outcome.registered.scan, outcome.deviations)
    header = job.header.of_files(design=design_file.filename, scan=scan_file.filename)
    del outcome  # the search trees of a scan of a million triangles take 300 MB, which the pictures need
    result = publish(
        *(result, out, settings, timer),
        lambda folder, built: (
            write_registration(folder, built, *written, settings, header)
            + _write_qdas(folder, built, settings)
        ),
    )
    has_files = bool(design.cached.files)  # those of the design, which the model keeps
    if design_cache is not None and (is_new or has_files is not had_files):
        design.save(design_cache)
    return result


def _write_qdas(folder: Path, result: RegistrationResult, settings: Settings) -> Artifacts:
    """The checks for statistics programs, where they are asked for and there are any."""
    if not settings.report.qdas or result.inspection is None or not result.inspection.checks:
        return Artifacts()
    (folder / qdas.NAME).write_bytes(qdas.dfq(result.inspection.checks, result.reference))
    return Artifacts((qdas.NAME,))


def compute_registration(
    design_file: MeshFile,
    scan_file: MeshFile,
    design: DesignModel | None,
    job: JobParameters,
    timer: StageTimer,
) -> RegistrationOutcome:
    """The method. design : the cached model of `design_file`, None to build it"""
    settings, seed = job.settings, job.seed
    input_design = None if design else read_mesh(design_file, "design", settings, timer, needs_surface=True)
    input_scan = read_mesh(scan_file, "scan", settings, timer, needs_surface=False)
    if input_design is not None:
        design = build_design(input_design, fingerprint(design_file, settings, seed), settings, timer, seed)
    assert design is not None  # noqa: S101 (for mypy: one of the two was given)
    check_places(design, job.acceptance, job.alignment)
    input_scan = input_scan.without(*without_oversize(input_scan.cleaned, design.analysis.mesh))
    input_scan = input_scan.without(*without_table(input_scan.cleaned, design.analysis.mesh, seed))
    scan = analyse_mesh(
        input_scan.mesh, "scan", design.scales, settings, timer, seed, stations=input_scan.stations
    )
    with timer.stage(Stage.MATCHING, "scan"):
        matched = match_scan(scan, design, job)
    with timer.stage(Stage.REGISTRATION):
        found = judged_pose(matched, input_scan, design, job)
        registered, checks, verdict = found.registered, found.checks, found.verdict
    has_pose = verdict.status in HAS_POSE
    with timer.stage(Stage.DEVIATION):
        aligned = align(registered, design, job) if has_pose else Aligned(registered.registration, None, None)
        deviations = _deviations(aligned.registration, design, job)
        of_design = _deviation_of_design(aligned.registration, design, job) if has_pose else None
        scale = _scale(registered, design, job) if has_pose else None
        alternatives = listed_alternatives(
            registered.registration, checks, design.surface, rejected=not has_pose
        )
    with timer.stage(Stage.INSPECTION):
        if has_pose and deviations.summary is not None:
            seen = None if of_design is None else of_design.seen
            inspection = inspect(
                *(aligned.registration, deviations, seen, design, verdict, job.acceptance),
                alignment_problem=aligned.problem,
                pose_error=aligned.pose_error,
            )
        else:
            inspection = without_pose(verdict, job.acceptance)
    return RegistrationOutcome(
        *(design, found.input_scan, registered, aligned, found.quality, checks, verdict),
        *(deviations, of_design, scale),
        alternatives=alternatives,
        inspection=inspection,
    )


def _deviations(registration: Registration, design: DesignModel, job: JobParameters) -> Deviations:
    segments, fit = design.analysis.segment_of_faces(), registration.fit
    return deviation(
        registration.scan, design.surface, fit, segments, job.tolerance_mm, job.settings.deviation
    )


def _deviation_of_design(
    registration: Registration, design: DesignModel, job: JobParameters
) -> DesignDeviation | None:
    return deviation_of_design(
        registration.scan,
        registration.scan_surface,
        design.surface,
        registration.fit,
        registration.inlier_distance_mm,
        job.tolerance_mm,
    )


def _scale(registered: RegisteredScan, design: DesignModel, job: JobParameters) -> ScaleDiagnosis:
    return diagnose_scale(
        registered.scan.mesh,
        registered.registration,
        design.surface,
        job.settings.registration.sample_points,
        job.seed,
    )
