"""The result records: JSON-ready, every field always present, unknown is null (never NaN or Infinity).

`RegistrationResult.model_dump_json()` is `results.json`. The schema is versioned; see the README for the
definition of each metric. `T` in prose is always `T_design_scan`: p_design_mm = T @ p_scan_mm.
"""

from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field

from pipeline.settings import Detector, SegmentationMethod

Vector3 = Annotated[list[float], Field(min_length=3, max_length=3)]
Matrix4 = Annotated[list[Annotated[list[float], Field(min_length=4, max_length=4)]], Field(min_length=4, max_length=4)]


class Record(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)


class Note(Record):
    """A warning: `code` for machines, `detail` for people."""

    code: str
    detail: str


class Finding(Record):
    """Something the verdict rests on or a person should know, whatever the status."""

    code: str
    detail: str
    value: float | None


VerdictStatus = Literal["ok", "units_suspect", "mirrored", "no_match", "under_constrained", "ambiguous"]


class Verdict(Record):
    status: VerdictStatus
    confidence: float | None = Field(
        ge=0,
        le=1,
        description="probability that the pose is right, from the evidence for it; 0 without a pose",
    )
    findings: list[Finding]


class Transform(Record):
    """The best proper (det +1) pose. `matrix` works on mm; `matrix_file_to_file` on the files' own units."""

    matrix: Matrix4
    source: Literal["scan"] = "scan"
    target: Literal["design"] = "design"
    convention: Literal["p_design_mm = M @ p_scan_mm"] = "p_design_mm = M @ p_scan_mm"
    units: Literal["mm"] = "mm"
    det: float
    rotation_deg: float
    quaternion_wxyz: Annotated[list[float], Field(min_length=4, max_length=4)]
    translation_mm: Vector3
    matrix_file_to_file: Matrix4


class Alternative(Record):
    """Another pose, or a symmetry of the design. `score`: over the winner's, >= 1; `rmse_mm`: on a sample of the scan."""

    matrix: Matrix4
    score: float
    rmse_mm: float
    symmetry_of_design: bool = Field(description="moving the design from the pose to this one leaves it the same")


class Metrics(Record):
    """Four RMSEs by one formula: area-weighted RMS distance of the cleaned scan's vertices to the design surface."""

    rmse_initial_mm: float = Field(description="RMSE_i: as uploaded")
    rmse_landmarks_mm: float | None = Field(description="RMSE_p: under the transform from landmarks alone")
    rmse_complete_mm: float = Field(description="RMSE_c: under ICP of the complete shape from the uploaded pose")
    k_ratio: float | None = Field(description="RMSE_c / RMSE_p")
    rmse_mm: float | None = Field(description="under the final transform; null when there is none")
    inlier_rmse_mm: float | None = Field(description="the same over scan vertices within inlier_distance_mm")
    inlier_distance_mm: float
    fitness: float | None = Field(description="area share of the scan within inlier_distance_mm of the design")
    scan_overlap: float | None = Field(
        description="area share of the scan within inlier_distance_mm, its closest design point not on an open border"
    )
    design_coverage: float | None = Field(description="area share of the design within inlier_distance_mm of the scan")
    iterations: int
    converged: bool


class Landmark(Record):
    id: int
    vertex: int = Field(description="vertex of <mesh>.clean.ply nearest to position_mm")
    position_mm: Vector3
    normal: Vector3
    segment: int
    t2: float = Field(description="T^2 by the spread of its segment (at most that of the part), which the limit is for")
    strength: float = Field(
        description="what landmarks are ordered by: T^2 by the spread of the whole part, over its limit, so that "
        "segments compare (statistics `segment`: by and over that of the segment)"
    )


class Match(Record):
    design: int
    scan: int
    residual_mm: float = Field(description="distance of the two landmarks under the final transform")


class Landmarks(Record):
    design: list[Landmark]
    scan: list[Landmark]
    matches: list[Match]


class Centre(Record):
    segment: int
    vertex: int
    position_mm: Vector3
    rho: float
    delta: float
    size: int = Field(description="vertices of the cleaned mesh in the segment")


class Segments(Record):
    count: int
    method: SegmentationMethod
    metric: Literal["surface", "crease"]
    density: Literal["vertex", "area", "convexity"]
    d_c: float = Field(description="cut-off distance in mm")
    halo_fraction: float = Field(description="share of the working vertices that are halo")
    limit_share: float | None = Field(
        description="share of the working vertices beyond the T^2 limit; null: no landmarks were looked for"
    )
    centres: list[Centre]


class SegmentsPair(Record):
    design: Segments
    scan: Segments | None = Field(description="null: the scan has no surface to segment")


class SegmentsOfMesh(Record):
    mesh: Segments


class SegmentDeviation(Record):
    segment: int
    n: int
    mean_mm: float
    sd_mm: float
    rms_mm: float
    min_mm: float
    max_mm: float


class Deviation(Record):
    """Signed distance (+ outside the design) of scan vertices, area-weighted; SD with ddof 0."""

    n: int
    mean_mm: float
    mean_abs_mm: float
    sd_mm: float
    rms_mm: float
    min_mm: float
    max_mm: float
    p01_mm: float
    p05_mm: float
    p50_mm: float
    p95_mm: float
    p99_mm: float
    tolerance_mm: float | None
    within: float | None
    above: float | None
    below: float | None
    by_segment: list[SegmentDeviation]


class FreeMotion(Record):
    kind: Literal["rotation", "translation", "screw"]
    axis: Vector3
    point_mm: Vector3
    sigma_mm: float = Field(
        description="standard deviation of the RMS displacement along it, with correlated residuals"
    )


class Observability(Record):
    """6x6 point-to-plane Hessian at the area centroid, rotations scaled by the part's RMS radius."""

    eigenvalues: list[float] = Field(description="ascending, mean over the inliers")
    condition_number: float | None
    free_motions: list[FreeMotion] = Field(
        description="less certain than the tolerance, or than a share of the diagonal"
    )


class Scale(Record):
    """Diagnosis only: a scale is never applied.

    unit_factor : of a `units_suspect` scan, what its numbers must be multiplied by; `transform` is of the scan so scaled
    """

    isotropic: float | None = Field(description="size of the scan over the design's: 0.996 is 0.4 % too small")
    per_axis: list[float] | None = Field(description="the same along x, y, z of the design; null: cannot tell")
    warp_mm: float | None = Field(
        description="RMS over patches of the mean distance left after scaling by axis: what is bent, not rough"
    )
    unit_factor: float | None
    applied: Literal[False] = False


class Input(Record):
    sha256: str
    format: str
    unit: str
    mm_per_unit: float
    cleaning: dict[str, int | float]


class Inputs(Record):
    design: Input
    scan: Input


class OneInput(Record):
    mesh: Input


class MadeBy(Record):
    """What made a result, beside its inputs."""

    version: str
    libraries: dict[str, str]
    settings: dict[str, Any]
    seed: int


class Provenance(MadeBy):
    inputs: Inputs


class OneProvenance(MadeBy):
    inputs: OneInput


class RegistrationResult(Record):
    """What a registration job found. `verdict.status` first; `transform` is null when there is no pose to stand by."""

    schema_version: Literal["1"] = "1"
    type: Literal["registration"] = "registration"
    verdict: Verdict
    transform: Transform | None
    alternatives: list[Alternative]
    metrics: Metrics
    landmarks: Landmarks
    segments: SegmentsPair
    deviation: Deviation | None
    observability: Observability | None
    scale: Scale | None
    provenance: Provenance
    timings_s: dict[str, float]
    files: list[str]
    warnings: list[Note]


class SegmentsResult(Record):
    """What `find_segments` found in one mesh. The centres' `vertex` is one of `mesh.segments.ply`."""

    schema_version: Literal["1"] = "1"
    type: Literal["segments"] = "segments"
    segments: SegmentsOfMesh
    provenance: OneProvenance
    timings_s: dict[str, float]
    files: list[str]
    warnings: list[Note]


class LandmarksOfMesh(Record):
    mesh: list[Landmark]


class LandmarksResult(Record):
    """What a landmarks job found in one mesh."""

    schema_version: Literal["1"] = "1"
    type: Literal["landmarks"] = "landmarks"
    segments: SegmentsOfMesh
    landmarks: LandmarksOfMesh
    provenance: OneProvenance
    timings_s: dict[str, float]
    files: list[str]
    warnings: list[Note]


class Quantiles(Record):
    """A distribution over trials."""

    n: int = Field(description="trials that gave a value")
    p05: float | None
    p25: float | None
    p50: float | None
    p75: float | None
    p95: float | None


class InformativenessProtocol(Record):
    """The paper's five steps on a shape of n points and its own copy: see `pipeline/informativeness.py`."""

    kind: Literal["informativeness"] = "informativeness"
    trials: int
    noise_mm: float = Field(description="the copy is moved by up to this along each axis")
    rotation_deg: float = Field(description="and turned by up to this")
    points: int = Field(description="points of the complete shape")
    count: int = Field(description="points a detector")
    icp: dict[str, str] = Field(description="what each ICP protocol is")
    tie: float = Field(description="RMSE_c and RMSE_p below this share of the diagonal are both rounding error: a tie")


class InformativenessRow(Record):
    """One detector under one ICP protocol; K = RMSE_c / RMSE_p over the vertices with their known partners."""

    detector: Detector
    icp: str
    points: int
    share_above: float = Field(description="of the trials with K > 1 + 1e-6, ties left out")
    share_tie: float = Field(description="of the trials where both errors are rounding error")
    share_at_least_10: float = Field(description="of the trials with K >= 10, ties left out")
    share_raw_above: float = Field(
        description="of the trials with K > 1 whatever the size of both, as the paper counts"
    )
    k: Quantiles
    rmse_complete_mm: Quantiles
    rmse_landmarks_mm: Quantiles


class RepeatabilityProtocol(Record):
    kind: Literal["repeatability"] = "repeatability"
    trials: int = Field(description="a condition")
    eps: float = Field(description="share of the diagonal")
    eps_mm: float
    count: int = Field(description="points a detector, on either mesh")
    spacing_mm: float = Field(description="least distance of two points of a detector, > 2 eps")
    conditions: list[str]


class RepeatabilityRow(Record):
    """One detector under one condition, over all its trials."""

    detector: Detector
    condition: str
    repeatability: Quantiles = Field(
        description="found again within eps, one to one, over `count` visible points asked"
    )
    mean: float = Field(description="of the repeatability")
    chance: float = Field(description="the same for random points of the same number, by the same count")
    points: float = Field(description="mean number of points a mesh; fewer than asked are misses")
    pose_error_mm: Quantiles = Field(
        description="RMS displacement of the true scan under the pose found from this detector's points alone"
    )
    pose_right: float = Field(description="share of trials with a pose within 1 % of the diagonal")


class StudyResult(Record):
    """What a study found: the protocol, one row a detector (and ICP protocol or condition), in words."""

    schema_version: Literal["1"] = "1"
    type: Literal["study"] = "study"
    protocol: InformativenessProtocol | RepeatabilityProtocol = Field(discriminator="kind")
    informativeness: list[InformativenessRow] | None = Field(description="null in the other kind of study")
    repeatability: list[RepeatabilityRow] | None = Field(description="null in the other kind of study")
    summary: str = Field(description="one paragraph in words")
    provenance: OneProvenance
    timings_s: dict[str, float]
    files: list[str]
    warnings: list[Note]
