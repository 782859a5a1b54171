"""Settings of the stages on both meshes: matching, registration, deviation."""

from pydantic import Field

from pipeline.core.settings.base import Section

#: Standard deviations of the scanner within which a point lies on the design, at most this share of the
#: diagonal. Chosen by hand: 99.7 % of a normal distribution.
INLIER_SIGMAS, MAX_INLIER_SHARE = 3.0, 0.04
#: Standard deviations of the scanner by which a scan of a right part may lie off it (RMS). Chosen by hand.
ACCURACY_SIGMAS = 1.5


class MatchingSettings(Section):
    length_share: float = Field(
        0.045, gt=0, lt=0.5, description="unit of length of matching, as a share of sqrt(area of the design)"
    )
    descriptor_radius_lengths: float = Field(5.0, gt=0, le=50, description="FPFH support in units of length")
    candidates: int = Field(8, ge=1, le=1_000, description="design landmarks tried for each scan landmark")
    max_pairs: int = Field(
        8_000,
        ge=100,
        le=1_000_000,
        description="maximum number of correspondence pairs that become poses, for each source",
    )
    max_hypotheses: int = Field(48, ge=1, le=10_000, description="distinct poses refined by a short ICP")
    sample_points: int = Field(1500, ge=100, le=100_000, description="scan points of the short ICP")
    axes_poses: bool = Field(True, description="also generate the 24 poses that align principal axes")
    dense_pairs: bool = Field(True, description="also generate poses from FPFH pairs of evenly spread points")


class RegistrationSettings(Section):
    inlier_share: float = Field(
        0.02, gt=0, lt=0.5, description="inlier distance as a share of the diagonal of the design"
    )
    max_iterations: int = Field(100, ge=1, le=10_000, description="of the final ICP")
    sample_points: int = Field(10_000, ge=500, le=1_000_000, description="scan points the final ICP uses")
    min_fitness: float = Field(
        0.75,
        ge=0,
        le=1,
        description="verdict no_match when less of the scan lies within the inlier distance",
    )
    min_coverage: float = Field(
        0.05, ge=0, le=1, description="verdict no_match when the scan shows less of the design than this"
    )
    scan_accuracy_mm: float | None = Field(
        None,
        gt=0,
        description="accuracy of the scanner, one sigma, as its maker states it; `options.scan_accuracy_mm` "
        "of a job overrides it; null: not stated",
    )
    max_residual_share: float = Field(
        0.009,
        gt=0,
        description="no verdict ok when the truncated RMS distance is above this share of the diagonal, or "
        "above what scan_accuracy_mm and the tolerance explain",
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

    def inlier_distance_mm(self, diagonal_mm: float) -> float:
        """Distance up to which a point counts as lying on the other surface, for a design of this diagonal:
        its share, more for a scanner whose stated accuracy asks for more.
        """
        wide_mm = min(INLIER_SIGMAS * (self.scan_accuracy_mm or 0.0), MAX_INLIER_SHARE * diagonal_mm)
        return max(self.inlier_share * diagonal_mm, wide_mm)

    def residual_limit_mm(self, diagonal_mm: float) -> float:
        """Truncated RMS distance that prints and the scanner leave of a right part of this diagonal."""
        part_mm = self.max_residual_share * diagonal_mm
        scanner_mm = ACCURACY_SIGMAS * (self.scan_accuracy_mm or 0.0)
        return float((part_mm**2 + scanner_mm**2) ** 0.5)


class DeviationSettings(Section):
    exclude_open_border: bool = Field(
        True, description="leave out scan vertices whose closest design point lies on an open border"
    )
