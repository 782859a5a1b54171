"""The pose of a registration: transform, alternatives, metrics, observability, scale."""

from typing import Annotated, Literal

from pydantic import Field

from pipeline.core.results.base import Matrix4, Record, Vector3


class Transform(Record):
    """The proper (det +1) pose of the scan in files, deviation and inspection: the best fit, or that of
    `options.alignment`. `matrix` works on mm; `matrix_file_to_file` on the files' own units.
    """

    matrix: Matrix4 = Field(description="4x4, rows: p_design_mm = matrix @ (p_scan_mm, 1)")
    source: Literal["scan"] = Field("scan", description="frame of the input points")
    target: Literal["design"] = Field("design", description="frame of the transformed points")
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
    """Another pose, or one that is equivalent by a symmetry of the design."""

    matrix: Matrix4 = Field(description="4x4, rows, as in `transform`")
    score: float = Field(
        description="its score over that of the best pose, as the verdict compares them: 1 is as good"
    )
    rmse_mm: float = Field(description="over the same vertices as `metrics.rmse_mm`")
    symmetry_of_design: bool = Field(
        description="the motion from the best pose to this one is a symmetry of the design"
    )
    equivalent_poses: int = Field(
        1,
        ge=1,
        description="how many poses it stands for: the poses by symmetry of the design are one row; "
        "`symmetry` has them all",
    )


class SymmetryAxis(Record):
    """An axis about which the design is its own image."""

    axis: Vector3 = Field(description="unit vector, in the frame of the design")
    point_mm: Vector3 = Field(description="a point that the axis goes through")
    order: int | None = Field(description="turns of 360/order degrees; null: continuous, any angle")


class Symmetry(Record):
    """The poses that are equivalent to `transform`, because they map the design onto itself."""

    kind: Literal["discrete", "continuous"] = Field(
        description="continuous: the scan may also turn or slide freely along the design"
    )
    order: int | None = Field(
        description="number of equivalent poses, `transform` included; null: infinitely many"
    )
    axes: list[SymmetryAxis] = Field(description="of the turns; empty where a motion is none")
    motions: list[Matrix4] = Field(
        description="4x4 each, design to design: `motion @ transform.matrix` is an equivalent pose"
    )


class ScanQuality(Record):
    """What the scan itself shows of the scanner."""

    noise_mm: float | None = Field(
        description="1 sigma of the scatter about the surface, from local surface fits; null: too few points"
    )
    noise_source: Literal["local_fit"] = Field(
        "local_fit",
        description="how `noise_mm` was measured: quadratic surfaces through neighbouring points at several "
        "scales. It does not see distortions that are smooth over many points",
    )
    accuracy_mm: float | None = Field(
        description="1 sigma of the scanner as stated in `options.scan_accuracy_mm` or the settings; null: "
        "not stated"
    )
    residual_limit_mm: float = Field(
        description="RMS distance (each at most the inlier distance) up to which a scan of the part may be "
        "`ok`; it follows from the stated accuracy, the tolerance and the size of the design"
    )
    left_out_share: float = Field(
        ge=0, le=1, description="share of the scan's area (points) in stray pieces that were left out"
    )


class Metrics(Record):
    """Four RMSEs by one formula: area-weighted RMS distance of the cleaned scan's vertices to the design
    surface.
    """

    rmse_initial_mm: float = Field(description="RMSE_i: as uploaded")
    rmse_landmarks_mm: float | None = Field(description="RMSE_p: under the transform from landmarks alone")
    rmse_complete_mm: float = Field(
        description="RMSE_c: under ICP of the complete shape from the uploaded pose"
    )
    k_ratio: float | None = Field(description="RMSE_c / RMSE_p")
    rmse_mm: float | None = Field(description="under the automatic pose (best fit); null when there is none")
    inlier_rmse_mm: float | None = Field(description="the same over scan vertices within inlier_distance_mm")
    inlier_distance_mm: float = Field(
        description="distance up to which a point counts as lying on the other surface"
    )
    fitness: float | None = Field(
        description="area share of the scan within inlier_distance_mm of the design"
    )
    scan_overlap: float | None = Field(
        description="area share of the scan within inlier_distance_mm, its closest design point not on an "
        "open border"
    )
    design_coverage: float | None = Field(
        description="area share of the design within inlier_distance_mm of the scan"
    )
    iterations: int = Field(description="of the final ICP")
    converged: bool = Field(description="whether the final ICP converged within `max_iterations`")


class FreeMotion(Record):
    kind: Literal["rotation", "translation", "screw"] = Field(
        description="type of motion that the data does not constrain"
    )
    axis: Vector3 = Field(description="unit vector, in the frame of the design")
    point_mm: Vector3 = Field(description="a point that the axis goes through")
    sigma_mm: float = Field(
        description="uncertainty of the motion (1 sigma, RMS displacement), correlated residuals considered"
    )


class Observability(Record):
    """6x6 point-to-plane Hessian at the area centroid, rotations scaled by the part's RMS radius."""

    eigenvalues: list[float] = Field(description="ascending, mean over the inliers")
    condition_number: float | None = Field(
        description="largest over smallest eigenvalue; null: the smallest is 0"
    )
    free_motions: list[FreeMotion] = Field(
        description="unconstrained motions: their uncertainty exceeds the tolerance, or a share of the "
        "diagonal"
    )


class ScaleFactor(Record):
    """Size of the scan over that of the design along an axis, and what would make up for it."""

    axis: Literal["all", "x", "y", "z"] = Field(
        description="axis of the design; `all`: one factor for all three"
    )
    scale: float | None = Field(
        description="size of the scan over that of the design: 0.996 is 0.4 % too small; null: see `reason`"
    )
    standard_error: float | None = Field(
        description="of `scale`, with residuals correlated within patches of the surface: 1.96 of it to both "
        "sides hold the size in 95 of 100 scans"
    )
    slicer_percent: float | None = Field(
        description="scale to set in the slicer so that the next print has its nominal size: 100 / `scale`; "
        "not applied to anything here"
    )
    reason: str | None = Field(description="why there is no number; null where there is one")


class Scale(Record):
    """Diagnosis only: a scale is never applied.

    unit_factor : of a `units_suspect` scan, what its numbers must be multiplied by; `transform` is of the
    scan so scaled
    """

    isotropic: float | None = Field(
        description="size of the scan over that of the design: 0.996 is 0.4 % too small"
    )
    per_axis: list[float] | None = Field(
        description="the same along x, y, z of the design; null: one of them is not determined"
    )
    factors: list[ScaleFactor] = Field(
        description="`all`, x, y, z: each with its standard error, or the reason why it is not determined"
    )
    warp_mm: float | None = Field(
        description="RMS over patches of the mean distance left after scaling by axis: residual deformation "
        "(warp, not roughness)"
    )
    unit_factor: float | None = Field(
        description="of a `units_suspect` scan, what its numbers must be multiplied by; null otherwise"
    )
    applied: Literal[False] = Field(False, description="a scale is never applied")
