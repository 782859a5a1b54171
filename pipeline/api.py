"""The public functions. They import the workflows when called, so that importing `pipeline` stays cheap."""

from collections.abc import Sequence
from pathlib import Path

from pipeline.core.acceptance import Acceptance
from pipeline.core.alignment import Alignment
from pipeline.core.job_parameters import JobParameters
from pipeline.core.mesh_file import MeshFile
from pipeline.core.progress import OnProgress, ignore
from pipeline.core.reference import Reference
from pipeline.core.report_header import ReportHeader
from pipeline.core.results import LandmarksResult, RegistrationResult, SegmentsResult, StudyResult
from pipeline.core.settings import Detector, Settings, StudyKind


def register(
    design: MeshFile | Path | str,
    scan: MeshFile | Path | str,
    *,
    settings: Settings | None = None,
    tolerance_mm: float | None = None,
    scan_accuracy_mm: float | None = None,
    acceptance: Acceptance | None = None,
    reference: Reference | None = None,
    alignment: Alignment | None = None,
    header: ReportHeader | None = None,
    seed: int = 0,
    out: Path | str | None = None,
    design_cache: Path | str | None = None,
    on_progress: OnProgress = ignore,
) -> RegistrationResult:
    """Find `T_design_scan`, the rigid motion that puts the scan on its design, and judge how far it can be
    trusted.

    Parameters
    ----------
    design, scan : files; the design must have triangles, the scan may be points
    tolerance_mm : > 0, for `deviation.within / above / below`; None leaves them null. It also says how
        certain the pose must be: `under_constrained` when a motion is less certain (one sigma); None:
        `registration.free_motion_share`.
    scan_accuracy_mm : > 0, accuracy of the scanner (one sigma), as its maker states it: how far a scan of a
        right part may lie off the design; None takes `registration.scan_accuracy_mm`, and without that only
        what the scan itself shows
    acceptance : what the part must satisfy: limits of its deviation, of regions and points; without any,
        `inspection.decision` is `not_judged`
    reference : identity of the part, carried through to the results
    alignment : how the scan lies on the design for deviation, inspection and files; None: as it fits best
    header : what the report says at its head beside the names of the files: job, date, company, logo
    seed : of every random draw; the same seed, files and settings give the same bytes
    out : folder for results.json and the files it lists; None writes nothing and `files` is empty
    design_cache : file where the analysis of the design is kept for its next scan; made when it is not there,
        or is of another design, other settings or another version. Results are the same with and without.
    on_progress : called with each `Progress`, in order

    Raises
    ------
    PipelineError
        When there can be no result: the file is unreadable or has no usable surface. "No pose found" is a
        result: `verdict.status == "no_match"`, `transform is None`.
    ValueError
        When `tolerance_mm` or `scan_accuracy_mm` is not above 0, or `acceptance` asks for a share of the area
        within limits that neither it nor `tolerance_mm` gives, or `alignment` fits to limits and there are
        none.
    """
    for name, length_mm in (("tolerance_mm", tolerance_mm), ("scan_accuracy_mm", scan_accuracy_mm)):
        if length_mm is not None and not 0 < length_mm < float("inf"):
            raise ValueError(f"{name} is {length_mm}; it must be above 0")
    from pipeline.workflows.registration import run_registration  # here: importing this module stays cheap

    return run_registration(
        MeshFile.of(design),
        MeshFile.of(scan),
        JobParameters.of(
            *(settings or Settings(), seed, tolerance_mm, scan_accuracy_mm),
            *(acceptance, reference, alignment, header),
        ),
        out=None if out is None else Path(out),
        design_cache=None if design_cache is None else Path(design_cache),
        on_progress=on_progress,
    )


def find_segments(
    mesh: MeshFile | Path | str,
    *,
    settings: Settings | None = None,
    out: Path | str | None = None,
    seed: int = 0,
    on_progress: OnProgress = ignore,
) -> SegmentsResult:
    """Cut one mesh into segments, by density peaks or by what `settings.segmentation.method` says.

    Parameters
    ----------
    mesh : a file with triangles
    out : folder for mesh.segments.ply (coloured by segment, halo pale), mesh.vertices.csv,
        mesh.decision_graph.svg and results.json; None writes nothing and `files` is empty
    seed : of the draws of some methods; the same seed, file and settings give the same bytes
    on_progress : called with each `Progress`, in order

    Raises
    ------
    PipelineError
        When the file is unreadable, has no usable surface, or only pieces too small to have a centre.
    """
    from pipeline.workflows.segments import run_segments

    return run_segments(
        MeshFile.of(mesh),
        settings=settings or Settings(),
        seed=seed,
        out=None if out is None else Path(out),
        on_progress=on_progress,
    )


def find_landmarks(
    mesh: MeshFile | Path | str,
    *,
    settings: Settings | None = None,
    out: Path | str | None = None,
    seed: int = 0,
    header: ReportHeader | None = None,
    on_progress: OnProgress = ignore,
) -> LandmarksResult:
    """Segments and landmarks of one mesh, by T^2 or by what `settings.landmarks.detector` says.

    Parameters
    ----------
    mesh : a file with triangles
    out : folder for landmarks.csv, mesh.clean.ply, mesh.vertices.csv, mesh.segments.ply,
        mesh.decision_graph.svg and results.json; None writes nothing and `files` is empty
    seed : of the draws of some detectors; the same seed, file and settings give the same bytes
    header : as of `register`
    on_progress : called with each `Progress`, in order

    Raises
    ------
    PipelineError
        When the file is unreadable, has no usable surface, or only pieces too small to have a centre.
        A surface without relief is a result: no landmarks, and the warning `no_landmarks`.
    """
    from pipeline.workflows.landmarks import run_landmarks

    return run_landmarks(
        MeshFile.of(mesh),
        settings=settings or Settings(),
        seed=seed,
        out=None if out is None else Path(out),
        on_progress=on_progress,
        header=header,
    )


def study(
    mesh: MeshFile | Path | str,
    *,
    kind: StudyKind | None = None,
    trials: int | None = None,
    detectors: Sequence[Detector] | None = None,
    noise_mm: float | None = None,
    eps: float | None = None,
    settings: Settings | None = None,
    out: Path | str | None = None,
    seed: int = 0,
    header: ReportHeader | None = None,
    on_progress: OnProgress = ignore,
) -> StudyResult:
    """Do landmarks carry what registration needs (`informativeness`, the paper's protocol), and are they
    found again on another mesh of the same shape (`repeatability`)?

    Parameters
    ----------
    mesh : a file with triangles
    kind, trials, detectors, noise_mm, eps : over `settings.study`, where each is described; None leaves it
    out : folder for results.json, trials.csv and study.svg; None writes nothing and `files` is empty
    seed : of every trial's draw; the same seed, file and settings give the same bytes, whatever the number of
    processors
    header : as of `register`
    on_progress : called with each `Progress`, in order

    Raises
    ------
    PipelineError
        When the file is unreadable or has no usable surface, or no detector gives three points.
    """
    from pipeline.workflows.study import run_study

    settings = settings or Settings()
    overrides = {"kind": kind, "trials": trials, "detectors": detectors, "noise_mm": noise_mm, "eps": eps}
    section = settings.study.model_dump() | {
        key: value for key, value in overrides.items() if value is not None
    }
    return run_study(
        MeshFile.of(mesh),
        settings=Settings.model_validate(settings.model_dump() | {"study": section}),
        seed=seed,
        out=None if out is None else Path(out),
        on_progress=on_progress,
        header=header,
    )


def preload() -> None:
    """Import everything that most jobs need, look up versions and compile the template of reports, so that a
    process forked from this one starts at once.

    Raises
    ------
    RuntimeError
        When a library or one of the pymeshlab filters in use is missing (a missing `libopengl0` does that).
    """
    import pipeline.workflows.landmarks
    import pipeline.workflows.registration
    import pipeline.workflows.segments
    import pipeline.workflows.study  # noqa: F401
    from pipeline.core.code_fingerprint import code_fingerprint
    from pipeline.kernels import remesh
    from pipeline.report import page
    from pipeline.workflows.provenance import versions

    remesh.assert_filters()
    code_fingerprint()
    versions()
    page.template()
