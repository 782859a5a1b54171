"""The result records: JSON-ready, every field always present, unknown is null (never NaN or Infinity).

`RegistrationResult.model_dump_json()` is `results.json`. The schema is versioned; see the README for the
definition of each metric. `T` in prose is always `T_design_scan`: p_design_mm = T @ p_scan_mm.
"""

from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field

from pipeline.core.settings import Detector, SegmentationMethod

Vector3 = Annotated[list[float], Field(min_length=3, max_length=3)]
Matrix4 = Annotated[
    list[Annotated[list[float], Field(min_length=4, max_length=4)]], Field(min_length=4, max_length=4)
]


class Record(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)


class Note(Record):
    """A warning: `code` for machines, `detail` for people."""

    code: str = Field(description="stable word for machines")
    detail: str = Field(description="the same in words, with figures")


class Finding(Record):
    """Something the verdict rests on or a person should know, whatever the status."""

    code: str = Field(description="stable word for machines, as in the table of findings")
    detail: str = Field(description="the same in words, with figures")
    value: float | None = Field(description="the figure it rests on; null where it has none")


VerdictStatus = Literal["ok", "units_suspect", "mirrored", "no_match", "under_constrained", "ambiguous"]


class Verdict(Record):
    status: VerdictStatus = Field(
        description="the first that applies, in the order of the README; only `ok` needs no look"
    )
    confidence: float | None = Field(
        ge=0,
        le=1,
        description="probability that the pose is right, from the evidence for it; 0 without a pose",
    )
    findings: list[Finding] = Field(
        description="what the status rests on, and what else a person should know"
    )


class Transform(Record):
    """The best proper (det +1) pose. `matrix` works on mm; `matrix_file_to_file` on the files' own units."""

    matrix: Matrix4 = Field(description="4x4, rows: p_design_mm = matrix @ (p_scan_mm, 1)")
    source: Literal["scan"] = Field("scan", description="frame it comes from")
    target: Literal["design"] = Field("design", description="frame it leads to")
    convention: Literal["p_design_mm = M @ p_scan_mm"] = Field(
        "p_design_mm = M @ p_scan_mm", description="how to apply it"
    )
    units: Literal["mm"] = Field("mm", description="of `matrix` and `translation_mm`")
    det: float = Field(description="determinant of the rotation: +1")
    rotation_deg: float = Field(description="angle of the rotation")
    quaternion_wxyz: Annotated[list[float], Field(min_length=4, max_length=4)] = Field(
        description="the rotation as a unit quaternion, w >= 0"
    )
    translation_mm: Vector3 = Field(description="last column of `matrix`")
    matrix_file_to_file: Matrix4 = Field(description="the same for coordinates in the two files' own units")


class Alternative(Record):
    """Another pose, or a symmetry of the design. `score`: over the winner's, >= 1; `rmse_mm`: on a sample of the scan."""

    matrix: Matrix4 = Field(description="4x4, rows, as in `transform`")
    score: float = Field(description="its cost over the winner's: 1 is as good")
    rmse_mm: float = Field(description="on a sample of the scan")
    symmetry_of_design: bool = Field(
        description="moving the design from the pose to this one leaves it the same"
    )


class Metrics(Record):
    """Four RMSEs by one formula: area-weighted RMS distance of the cleaned scan's vertices to the design surface."""

    rmse_initial_mm: float = Field(description="RMSE_i: as uploaded")
    rmse_landmarks_mm: float | None = Field(description="RMSE_p: under the transform from landmarks alone")
    rmse_complete_mm: float = Field(
        description="RMSE_c: under ICP of the complete shape from the uploaded pose"
    )
    k_ratio: float | None = Field(description="RMSE_c / RMSE_p")
    rmse_mm: float | None = Field(description="under the final transform; null when there is none")
    inlier_rmse_mm: float | None = Field(description="the same over scan vertices within inlier_distance_mm")
    inlier_distance_mm: float = Field(
        description="distance up to which a point counts as lying on the other surface"
    )
    fitness: float | None = Field(
        description="area share of the scan within inlier_distance_mm of the design"
    )
    scan_overlap: float | None = Field(
        description="area share of the scan within inlier_distance_mm, its closest design point not on an open border"
    )
    design_coverage: float | None = Field(
        description="area share of the design within inlier_distance_mm of the scan"
    )
    iterations: int = Field(description="of the final ICP")
    converged: bool = Field(description="whether the final ICP came to rest before `max_iterations`")


class Landmark(Record):
    id: int = Field(description="counts from 0, the strongest first")
    vertex: int = Field(description="vertex of <mesh>.clean.ply nearest to position_mm")
    position_mm: Vector3 = Field(description="in the mesh's own frame, in mm")
    normal: Vector3 = Field(description="unit outward normal there")
    segment: int = Field(description="number of its segment")
    t2: float = Field(
        description="T^2 by the spread of its segment (at most that of the part), which the limit is for"
    )
    strength: float = Field(
        description="what landmarks are ordered by: T^2 by the spread of the whole part, over its limit, so that "
        "segments compare (statistics `segment`: by and over that of the segment)"
    )


class Match(Record):
    design: int = Field(description="`id` of the landmark of the design")
    scan: int = Field(description="`id` of the landmark of the scan")
    residual_mm: float = Field(description="distance of the two landmarks under the final transform")


class Landmarks(Record):
    design: list[Landmark] = Field(description="of the design, the strongest first")
    scan: list[Landmark] = Field(description="of the scan, the strongest first")
    matches: list[Match] = Field(description="which landmarks are the same place; empty without a pose")


class Centre(Record):
    segment: int = Field(description="number of the segment, from 0")
    vertex: int = Field(description="its density peak, a vertex of <mesh>.clean.ply")
    position_mm: Vector3 = Field(description="of the peak, in the frame of the mesh")
    rho: float = Field(description="density at the peak (Rodriguez & Laio)")
    delta: float = Field(description="geodesic distance in mm to the nearest point of higher density")
    size: int = Field(description="vertices of the cleaned mesh in the segment")


class Segments(Record):
    count: int = Field(description="number of segments")
    method: SegmentationMethod = Field(description="the clustering")
    metric: Literal["surface", "crease"] = Field(
        description="what distances are measured along: the surface, or the surface with creases made longer"
    )
    density: Literal["vertex", "area", "convexity"] = Field(
        description="what rho counts: vertices, area, or area by convexity"
    )
    d_c: float = Field(description="cut-off distance in mm")
    halo_fraction: float = Field(description="share of the working vertices that are halo")
    limit_share: float | None = Field(
        description="share of the working vertices beyond the T^2 limit; null: no landmarks were looked for"
    )
    centres: list[Centre] = Field(description="the density peaks, by segment")


class SegmentsPair(Record):
    design: Segments = Field(description="of the design")
    scan: Segments | None = Field(description="null: the scan has no surface to segment")


class SegmentsOfMesh(Record):
    mesh: Segments = Field(description="of the mesh")


class Spread(Record):
    """A distribution of signed distances, area-weighted, so that rms^2 = mean^2 + sd^2."""

    n: int = Field(description="vertices counted")
    mean_mm: float = Field(description="weighted mean, with the sign")
    sd_mm: float = Field(description="standard deviation, ddof 0")
    rms_mm: float = Field(description="root mean square")
    min_mm: float = Field(description="the farthest inwards: material is missing")
    max_mm: float = Field(description="the farthest outwards: material too much")


class SegmentDeviation(Spread):
    segment: int = Field(description="number of the segment of the design that the vertices lie closest to")


class Distances(Spread):
    """The same with quantiles (the smallest distance that the share reaches), and shares of the area by tolerance."""

    mean_abs_mm: float = Field(description="weighted mean without the sign")
    p01_mm: float = Field(description="1 % of the area is at most here")
    p05_mm: float = Field(description="5 % of the area is at most here")
    p50_mm: float = Field(description="median")
    p95_mm: float = Field(description="95 % of the area is at most here")
    p99_mm: float = Field(description="99 % of the area is at most here")
    tolerance_mm: float | None = Field(description="as sent in `options`; null: none was")
    within: float | None = Field(description="share of the area within +- tolerance_mm; null without one")
    above: float | None = Field(description="share of the area above + tolerance_mm; null without one")
    below: float | None = Field(description="share of the area below - tolerance_mm; null without one")


DesignSide = Literal["closed", "open", "none"]


class Deviation(Distances):
    """Distance of every scan vertex to the surface of the design, + outside; those at an open border are left out."""

    sign: DesignSide = Field(
        description="`closed`: + is outside of the design; `open`: + is the side its faces look to; `none`: its faces "
        "look to no common side, so that distances have no sign"
    )
    by_segment: list[SegmentDeviation] = Field(description="by the segment of the design")


class DesignDeviation(Distances):
    """The other direction: distance of design vertices to the scan, + where the scan stands out of the design there.

    It sees what no scan vertex lies near: a piece that broke off, a hole that was filled. What the scan does not show (its
    closest point is on an open border of the scan; of points, farther than the inlier distance) is not counted.
    """

    seen: float = Field(description="share of the area of the design that is counted")


class FreeMotion(Record):
    kind: Literal["rotation", "translation", "screw"] = Field(
        description="how the part can move without leaving its design"
    )
    axis: Vector3 = Field(description="unit vector, in the frame of the design")
    point_mm: Vector3 = Field(description="a point that the axis goes through")
    sigma_mm: float = Field(
        description="standard deviation of the RMS displacement along it, with correlated residuals"
    )


class Observability(Record):
    """6x6 point-to-plane Hessian at the area centroid, rotations scaled by the part's RMS radius."""

    eigenvalues: list[float] = Field(description="ascending, mean over the inliers")
    condition_number: float | None = Field(
        description="largest over smallest eigenvalue; null: the smallest is 0"
    )
    free_motions: list[FreeMotion] = Field(
        description="less certain than the tolerance, or than a share of the diagonal"
    )


class Scale(Record):
    """Diagnosis only: a scale is never applied.

    unit_factor : of a `units_suspect` scan, what its numbers must be multiplied by; `transform` is of the scan so scaled
    """

    isotropic: float | None = Field(
        description="size of the scan over the design's: 0.996 is 0.4 % too small"
    )
    per_axis: list[float] | None = Field(
        description="the same along x, y, z of the design; null: cannot tell"
    )
    warp_mm: float | None = Field(
        description="RMS over patches of the mean distance left after scaling by axis: what is bent, not rough"
    )
    unit_factor: float | None = Field(
        description="of a `units_suspect` scan, what its numbers must be multiplied by; null otherwise"
    )
    applied: Literal[False] = Field(False, description="a scale is never applied")


class Input(Record):
    sha256: str = Field(description="of the file, hex")
    format: str = Field(description="by its content: stl, ply, obj, off, 3mf, glb, xyz")
    unit: str = Field(description="what its numbers were taken as")
    mm_per_unit: float = Field(description="what they were multiplied by")
    cleaning: dict[str, int | float] = Field(description="what was removed or repaired, by kind, with counts")


class Inputs(Record):
    design: Input = Field(description="the design file")
    scan: Input = Field(description="the scan file")


class OneInput(Record):
    mesh: Input = Field(description="the mesh file")


class MadeBy(Record):
    """What made a result, beside its inputs."""

    version: str = Field(description="of Cusp")
    libraries: dict[str, str] = Field(description="versions of what it computes with")
    settings: dict[str, Any] = Field(description="every setting of the method, as it was used")
    seed: int = Field(description="of every random draw")


class Provenance(MadeBy):
    inputs: Inputs = Field(description="the files")
    limits: dict[str, Any] = Field(
        description="every number that decides the pose or the verdict and is not in `settings`, by group"
    )


class OneProvenance(MadeBy):
    inputs: OneInput = Field(description="the file")


class RegistrationResult(Record):
    """What a registration job found. `verdict.status` first; `transform` is null when there is no pose to stand by."""

    schema_version: Literal["1"] = Field(
        "1", description="of this document; fields are only added within a version"
    )
    type: Literal["registration"] = Field("registration", description="type of the job")
    verdict: Verdict = Field(description="read this first")
    transform: Transform | None = Field(
        description="the pose of the scan on the design; null: none to stand by"
    )
    alternatives: list[Alternative] = Field(
        description="other poses that fit, and symmetries; of `no_match` and `mirrored` what was tried and rejected"
    )
    metrics: Metrics = Field(description="RMSEs, fitness, overlap")
    landmarks: Landmarks = Field(description="of both meshes, and how they match")
    segments: SegmentsPair = Field(description="of both meshes")
    deviation: Deviation | None = Field(description="of the scan from the design; null without a pose")
    deviation_of_design: DesignDeviation | None = Field(
        description="of the design from the scan; null without a pose, or where the scan shows none of it"
    )
    observability: Observability | None = Field(
        description="which motions the data cannot see; null without a pose"
    )
    scale: Scale | None = Field(description="diagnosis of size and warp; null without a pose")
    provenance: Provenance = Field(description="what this was made from and with")
    timings_s: dict[str, float] = Field(description="seconds by stage; not part of what repeats to the byte")
    files: list[str] = Field(description="names of the files beside this one")
    warnings: list[Note] = Field(description="what a person should know; nothing that stopped the job")


class SegmentsResult(Record):
    """What `find_segments` found in one mesh. The centres' `vertex` is one of `mesh.segments.ply`."""

    schema_version: Literal["1"] = Field(
        "1", description="of this document; fields are only added within a version"
    )
    type: Literal["segments"] = Field("segments", description="type of the job")
    segments: SegmentsOfMesh = Field(description="of the mesh")
    provenance: OneProvenance = Field(description="what this was made from and with")
    timings_s: dict[str, float] = Field(description="seconds by stage; not part of what repeats to the byte")
    files: list[str] = Field(description="names of the files beside this one")
    warnings: list[Note] = Field(description="what a person should know; nothing that stopped the job")


class LandmarksOfMesh(Record):
    mesh: list[Landmark] = Field(description="of the mesh, the strongest first")


class LandmarksResult(Record):
    """What a landmarks job found in one mesh."""

    schema_version: Literal["1"] = Field(
        "1", description="of this document; fields are only added within a version"
    )
    type: Literal["landmarks"] = Field("landmarks", description="type of the job")
    segments: SegmentsOfMesh = Field(description="of the mesh")
    landmarks: LandmarksOfMesh = Field(description="of the mesh")
    provenance: OneProvenance = Field(description="what this was made from and with")
    timings_s: dict[str, float] = Field(description="seconds by stage; not part of what repeats to the byte")
    files: list[str] = Field(description="names of the files beside this one")
    warnings: list[Note] = Field(description="what a person should know; nothing that stopped the job")


class Quantiles(Record):
    """A distribution over trials."""

    n: int = Field(description="trials that gave a value")
    p05: float | None = Field(description="5 % of the trials are below; null: no trial gave a value")
    p25: float | None = Field(description="25 % of the trials are below; null: no trial gave a value")
    p50: float | None = Field(description="50 % of the trials are below; null: no trial gave a value")
    p75: float | None = Field(description="75 % of the trials are below; null: no trial gave a value")
    p95: float | None = Field(description="95 % of the trials are below; null: no trial gave a value")


class InformativenessProtocol(Record):
    """The paper's five steps on a shape of n points and its own copy: see `pipeline/studies/informativeness.py`."""

    kind: Literal["informativeness"] = Field("informativeness", description="the paper's protocol")
    trials: int = Field(description="a detector")
    noise_mm: float = Field(description="the copy is moved by up to this along each axis")
    rotation_deg: float = Field(description="and turned by up to this")
    points: int = Field(description="points of the complete shape")
    count: int = Field(description="points a detector")
    icp: dict[str, str] = Field(description="what each ICP protocol is")
    tie: float = Field(
        description="RMSE_c and RMSE_p below this share of the diagonal are both rounding error: a tie"
    )


class InformativenessRow(Record):
    """One detector under one ICP protocol; K = RMSE_c / RMSE_p over the vertices with their known partners."""

    detector: Detector = Field(description="the landmark detector")
    icp: str = Field(description="name of the ICP protocol")
    points: int = Field(description="points it gave")
    share_above: float = Field(description="of the trials with K > 1 + 1e-6, ties left out")
    share_tie: float = Field(description="of the trials where both errors are rounding error")
    share_at_least_10: float = Field(description="of the trials with K >= 10, ties left out")
    share_raw_above: float = Field(
        description="of the trials with K > 1 whatever the size of both, as the paper counts"
    )
    k: Quantiles = Field(description="RMSE_c / RMSE_p, ties left out")
    rmse_complete_mm: Quantiles = Field(description="RMSE_c")
    rmse_landmarks_mm: Quantiles = Field(description="RMSE_p")


class RepeatabilityProtocol(Record):
    kind: Literal["repeatability"] = Field(
        "repeatability", description="are landmarks found again on another mesh of the shape"
    )
    trials: int = Field(description="a condition")
    eps: float = Field(description="share of the diagonal")
    eps_mm: float = Field(description="the same in mm: found again means within it")
    count: int = Field(description="points a detector, on either mesh")
    spacing_mm: float = Field(description="least distance of two points of a detector, > 2 eps")
    conditions: list[str] = Field(description="what the other meshes went through")


class RepeatabilityRow(Record):
    """One detector under one condition, over all its trials."""

    detector: Detector = Field(description="the landmark detector")
    condition: str = Field(description="one of `conditions`")
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

    schema_version: Literal["1"] = Field(
        "1", description="of this document; fields are only added within a version"
    )
    type: Literal["study"] = Field("study", description="type of the job")
    protocol: InformativenessProtocol | RepeatabilityProtocol = Field(
        discriminator="kind", description="what was done"
    )
    informativeness: list[InformativenessRow] | None = Field(description="null in the other kind of study")
    repeatability: list[RepeatabilityRow] | None = Field(description="null in the other kind of study")
    summary: str = Field(description="one paragraph in words")
    provenance: OneProvenance = Field(description="what this was made from and with")
    timings_s: dict[str, float] = Field(description="seconds by stage; not part of what repeats to the byte")
    files: list[str] = Field(description="names of the files beside this one")
    warnings: list[Note] = Field(description="what a person should know; nothing that stopped the job")
