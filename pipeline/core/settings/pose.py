"""Settings of the stages on both meshes: matching, registration, deviation."""

from pydantic import Field

from pipeline.core.settings.base import Section


class MatchingSettings(Section):
    length_share: float = Field(
        0.045, gt=0, lt=0.5, description="unit of length of matching, as a share of sqrt(area of the design)"
    )
    descriptor_radius_lengths: float = Field(5.0, gt=0, description="FPFH support in units of length")
    candidates: int = Field(8, ge=1, description="design landmarks tried for each scan landmark")
    max_pairs: int = Field(
        8_000, ge=100, description="maximum number of correspondence pairs that become poses, for each source"
    )
    max_hypotheses: int = Field(48, ge=1, description="distinct poses refined by a short ICP")
    sample_points: int = Field(1500, ge=100, description="scan points of the short ICP")
    axes_poses: bool = Field(True, description="also generate the 24 poses that align principal axes")
    dense_pairs: bool = Field(True, description="also generate poses from FPFH pairs of evenly spread points")


class RegistrationSettings(Section):
    inlier_share: float = Field(
        0.02, gt=0, lt=0.5, description="inlier distance as a share of the diagonal of the design"
    )
    max_iterations: int = Field(100, ge=1, le=10_000, description="of the final ICP")
    sample_points: int = Field(10_000, ge=500, description="scan points the final ICP uses")
    min_fitness: float = Field(
        0.75,
        ge=0,
        le=1,
        description="verdict no_match when less of the scan lies within the inlier distance",
    )
    min_coverage: float = Field(
        0.05, ge=0, le=1, description="verdict no_match when the scan shows less of the design than this"
    )
    max_residual_share: float = Field(
        0.009,
        gt=0,
        description="verdict no_match when the truncated RMS distance is above this share of the diagonal",
    )
    rival_margin: float = Field(
        1.25,
        ge=1,
        description="verdict ambiguous when another pose scores less than this many times the best",
    )
    free_motion_share: float = Field(
        0.005,
        gt=0,
        description="verdict under_constrained when a motion is less certain (one sigma) than this share of "
        "the diagonal",
    )
    mirror_share: float = Field(
        0.0025,
        ge=0,
        description="test the mirror image when the residual is above this share of the diagonal",
    )
    mirror_gain: float = Field(
        0.6,
        gt=0,
        le=1,
        description="verdict mirrored when the reflection leaves less than this share of the residual",
    )


class DeviationSettings(Section):
    exclude_open_border: bool = Field(
        True, description="leave out scan vertices whose closest design point lies on an open border"
    )
