"""One example of every problem and of every document of the API.

`cusp openapi` writes them to openapi/examples/, and the OpenAPI document shows them. Tests validate them.
"""

from typing import Any

from pipeline import Acceptance, PipelineError, Reference, StudySettings
from pipeline import errors as mesh
from service.contract import errors
from service.contract.errors import ServiceError, problem_of
from service.contract.schemas import (
    Blob,
    BlobRef,
    JobRequest,
    LandmarksRequest,
    Options,
    Problem,
    ProblemItem,
    RegistrationRequest,
    Status,
    StudyRequest,
    Units,
)
from service.execution.exit_reasons import out_of_disk_detail
from service.execution.forked import out_of_memory_detail
from service.jobs.models import JobRow
from service.jobs.views import job_of

JOB_ID = "01a2019a-6685-7220-8c73-80d9802cf568"
BLOB_ID = "sha256:697b00ab13410c52a542d2e9c63711fcc04e9cbf6c0d3439a9b43cc812e6e713"
OTHER_BLOB_ID = "sha256:8036011d143b572d2d6340235f226d69dbd4d8b0da3ac1ea86157bd001ac8ac7"
INSTANCE = "urn:uuid:2d065e46-4b4f-4258-9d4a-67fa132bb587"

MISSING_SCAN = "missing; send it as a file of the form, with curl -F scan=@FILE"
UNKNOWN_KEY = "unknown key; did you mean tolerance_mm?"

SERVICE_ERRORS: list[ServiceError] = [
    errors.BadRequest("options: not JSON (Expecting value: line 1 column 1 (char 0)); send a JSON object"),
    errors.InvalidRequest(
        f"scan: {MISSING_SCAN}", errors=[ProblemItem(pointer="/scan", detail=MISSING_SCAN)]
    ),
    errors.InvalidOptions(
        f"options.tolerance: {UNKNOWN_KEY}",
        errors=[ProblemItem(pointer="/options/tolerance", detail=UNKNOWN_KEY)],
    ),
    errors.UnsupportedType(
        "type 'segment': must be registration, landmarks or study; without a type it is registration"
    ),
    errors.RateLimited("more than 1000 requests per second; send it again in 1 s"),
    errors.TooManyWatchers(
        "5000 requests of this tenant are already waiting for jobs; poll without `wait`, or use webhooks"
    ),
    errors.TenantQueueFull(
        "a tenant may have 15000 jobs that wait, and with this there would be more; send it again when "
        "some have ended"
    ),
    errors.UnknownBlob(f"design: no blob {BLOB_ID} is stored; send it by PUT /v1/blobs first"),
    errors.MeshNotFetched(
        "scan: https://files.example.com/a.ply answers 403; the address may be wrong or expired"
    ),
    errors.PayloadTooLarge(
        "the request is larger than the limit of 512 MiB; decimate the meshes, or raise CUSP_MAX_UPLOAD_MIB"
    ),
    errors.UnsupportedMediaType(
        "Content-Type 'text/plain': send the files as multipart/form-data (with curl: -F design=@FILE "
        "-F scan=@FILE), or a JSON body as application/json"
    ),
    errors.IdempotencyMismatch(
        "Idempotency-Key 'order-7': it was used for a job with other meshes or options; use a new key"
    ),
    errors.DigestMismatch(
        "Content-Digest announces sha-256 l5wr..., but the received content has qNsE...; send it again"
    ),
    errors.Unauthorized("the API key is unknown or revoked; ask the operator for another one"),
    errors.Forbidden(
        "this needs a key with the scope jobs:write; the key 1f0c9a77b2e4 has jobs:read; "
        "ask the operator for another key"
    ),
    errors.NotFound("there is nothing at /v1/job; /docs lists the addresses"),
    errors.MethodNotAllowed("/v1/jobs does not take PUT; /docs lists the methods of each address"),
    errors.JobNotFound(
        f"no job has the id '{JOB_ID}': check the id and the API key; ended jobs are removed after some time"
    ),
    errors.BatchNotFound(f"no batch has the id '{JOB_ID}'; see /v1/batches"),
    errors.NoCharacteristics(f"nothing is kept with {BLOB_ID}; PUT it here"),
    errors.PreconditionFailed(
        f"what is kept with {BLOB_ID} is another version than If-Match names; get it, and repeat the change"
    ),
    errors.DeliveryNotFound(f"job {JOB_ID} has no message 'msg_7'; see /v1/jobs/{JOB_ID}/deliveries"),
    errors.FileNotInJob(f"job {JOB_ID} has no file 'report.pdf'; see /v1/jobs/{JOB_ID}/files"),
    errors.JobNotFinal(
        f"job {JOB_ID} is running, so it has no results yet; poll GET /v1/jobs/{JOB_ID} until it ends"
    ),
    errors.JobFinal(
        f"job {JOB_ID} is successful already, so there is nothing to cancel; to remove it: DELETE "
        f"/v1/jobs/{JOB_ID}"
    ),
    errors.JobDismissed(f"job {JOB_ID} was cancelled and has no results; start a new one"),
    errors.QuotaExceeded(
        "meshes and results of this tenant take 10239 MiB, and the quota is 10240 MiB; remove jobs that "
        "are no "
        "longer needed, or wait until the service removes old ones"
    ),
    errors.StorageFull(
        "too little room on the data volume of the service: 871 MiB are free, and 1024 MiB must stay free; "
        "send it again later, or tell the operator"
    ),
    errors.QueueFull("20000 jobs may wait, and with this there would be more; send it again later"),
    errors.NotReady("no worker is running; jobs are accepted, and wait until one starts"),
    errors.InternalError(f"an unexpected error; report it with the id {INSTANCE}"),
    errors.JobCrashed(
        "the job's process was killed by SIGSEGV: a fault in native code, usually caused by a damaged mesh: "
        "repair it and send it again"
    ),
    errors.JobOutOfMemory(out_of_memory_detail(4096)),
    errors.JobOutOfDisk(out_of_disk_detail(4096)),
    errors.JobTimedOut(
        "the job exceeded its time limit of 900 s and was stopped; decimate the meshes, "
        "lower resample.target_vertices or the trials of a study, or raise CUSP_JOB_TIME_LIMIT_S"
    ),
]

MESH_ERRORS: list[PipelineError] = [
    mesh.EmptyFile("the file is empty", mesh="scan"),
    mesh.UnknownFormat(
        "the content of the file is in no supported format (its name ends in '.stl')", mesh="design"
    ),
    mesh.TruncatedFile(
        "the STL header announces 4294967295 triangles, which is 214748364834 bytes; the file has 684",
        mesh="scan",
    ),
    mesh.UnreadableFile("line 812 of the OBJ file has a vertex with two numbers", mesh="scan"),
    mesh.MeshTooLarge("7340032 triangles; the limit is 5000000", mesh="scan"),
    mesh.NotFinite("3 of 5120 vertices are NaN or infinite; the first has index 17", mesh="scan"),
    mesh.CoordinateOutOfRange(
        "1 of 5120 vertices lie more than 100,000,000 mm from the origin, the first at (0, 0, 3.4e+38) mm",
        mesh="scan",
    ),
    mesh.IndexOutOfRange(
        "triangle 5 refers to vertex 900, but the mesh has 812 vertices, counted from 0", mesh="design"
    ),
    mesh.NoSurface("the PLY has 684 points and no triangles", mesh="design"),
    mesh.PartNotFound("there is no part 'lid'; the file has 2: 1 bracket, 2 cover", mesh="design"),
    mesh.UnknownRegion("region 'rim' names segment 12, but the design has 9 (0 to 8)", mesh="design"),
    mesh.PointOffSurface(
        "inspection point 'P7' is 4.2 mm off the design's surface, more than its radius_mm of 1",
        mesh="design",
    ),
    mesh.ColumnsUnfit(
        "line 1 has no numbers in the columns that options.columns states: '1 0.5'", mesh="scan"
    ),
    mesh.UnitUnknown("the file declares the unit 'league'", mesh="design"),
    mesh.DegenerateMesh("the surface has no area", mesh="scan"),
    mesh.TooFewPoints("3 distinct points; at least 10 are required", mesh="scan"),
    mesh.ResampleFailed("remeshing to edges of 0.4 mm produced no triangles", mesh="scan"),
    mesh.ComponentsTooSmall(
        "the largest of 400 connected components has 0.62% of the area; at least 1.00% is required",
        mesh="scan",
    ),
    mesh.TooFewLandmarks("no detector found 3 points (t2 0)", mesh="mesh"),
]


def examples() -> dict[str, Any]:
    """File name -> JSON content."""
    raised: list[PipelineError | ServiceError] = [*SERVICE_ERRORS, *MESH_ERRORS]
    problems = {f"problem.{error.code}.json": problem_example(error) for error in raised}
    documents = {
        **{
            f"job_request.{each.type}.json": each.model_dump(mode="json", exclude_unset=True)
            for each in _requests()
        },
        "options.json": _registration().options.model_dump(mode="json"),
        "blob.json": Blob(id=BLOB_ID, size=684, format="stl").model_dump(mode="json"),
        **{f"job.{status.value}.json": _job(status).model_dump(mode="json") for status in Status},
    }
    return dict(sorted({**problems, **documents}.items()))


def problem_example(error: PipelineError | ServiceError) -> dict[str, Any]:
    """A problem as a client receives it."""
    instance = INSTANCE if isinstance(error, errors.InternalError) else None
    return problem_of(error, instance=instance).model_dump(mode="json", exclude_none=True)


def _requests() -> list[JobRequest]:
    """One of each type."""
    part = BlobRef(blob=BLOB_ID, filename="bracket.stl")
    landmarks = Options(settings={"landmarks": {"count": 20}}, units=Units(mesh="mm"), label="bracket")
    study = StudySettings(kind="informativeness", trials=1000, detectors=("t2", "iss", "random"))
    return [
        _registration(),
        LandmarksRequest(type="landmarks", mesh=part, options=landmarks),
        StudyRequest(type="study", mesh=part, options=Options(study=study, seed=7)),
    ]


def _registration() -> RegistrationRequest:
    return RegistrationRequest(
        type="registration",
        design=BlobRef(blob=BLOB_ID, filename="bracket.stl"),
        scan=BlobRef(blob=OTHER_BLOB_ID, filename="bracket-0042.ply"),
        options=Options(
            settings={"resample": {"target_vertices": 5000}},
            units=Units(design="mm", scan="m"),
            tolerance_mm=0.1,
            scan_accuracy_mm=0.02,
            acceptance=Acceptance(tolerance_mm=0.1, min_within=0.95, max_deviation_mm=0.3, min_coverage=0.8),
            reference=Reference(part_number="BR-7", serial="0042", batch="2026-11"),
            design_part="2",
            columns="id,x,y,z",
            seed=7,
            label="bracket-0042",
        ),
    )


def _job(status: Status) -> Any:
    has_started = status is not Status.ACCEPTED
    crash = next(error for error in MESH_ERRORS if isinstance(error, mesh.NotFinite))
    problem: Problem | None = problem_of(crash) if status is Status.FAILED else None
    row = JobRow(
        id=JOB_ID,
        type="registration",
        status=status,
        stage={Status.RUNNING: "geodesics", Status.SUCCESSFUL: "report", Status.FAILED: "load"}.get(status),
        progress={Status.RUNNING: 31.5, Status.SUCCESSFUL: 100.0, Status.FAILED: 1.0}.get(status, 0.0),
        message="distances on the scan" if status is Status.RUNNING else None,
        label="bracket-0042",
        inputs={
            "design": {"blob": BLOB_ID, "filename": "bracket.stl"},
            "scan": {"blob": OTHER_BLOB_ID, "filename": "bracket-0042.ply"},
        },
        created_ms=1_790_000_000_000,
        started_ms=1_790_000_000_060 if has_started else None,
        finished_ms=1_790_000_004_210 if status.is_final else None,
        attempt=1 if has_started else 0,
        error=problem.model_dump(exclude_none=True) if problem else None,
        verdict="ok" if status is Status.SUCCESSFUL else None,
        decision="pass" if status is Status.SUCCESSFUL else None,
        within=0.957 if status is Status.SUCCESSFUL else None,
        options={"reference": {"part_number": "BR-7", "serial": "0042", "batch": "2026-11"}},
    )
    return job_of(row)
