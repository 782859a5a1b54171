"""What a registration job states beside its meshes."""

from dataclasses import dataclass, field

from pipeline.core.acceptance import Acceptance
from pipeline.core.alignment import Alignment, limits_are_given
from pipeline.core.reference import Reference
from pipeline.core.report_header import ReportHeader
from pipeline.core.settings import Settings


@dataclass(frozen=True, slots=True)
class JobParameters:
    """settings; seed : of every random draw; tolerance_mm : of the part, None where the job states none;
    acceptance : what the part must satisfy, None where nothing is stated; reference : of the part, carried
    through; alignment : the one that deviation and inspection use, None for the automatic pose; header : of
    the report
    """

    settings: Settings
    seed: int
    tolerance_mm: float | None
    acceptance: Acceptance | None = None
    reference: Reference | None = None
    alignment: Alignment | None = None
    header: ReportHeader = field(default_factory=ReportHeader)

    @classmethod
    def of(
        cls,
        settings: Settings,
        seed: int,
        tolerance_mm: float | None,
        scan_accuracy_mm: float | None,
        acceptance: Acceptance | None = None,
        reference: Reference | None = None,
        alignment: Alignment | None = None,
        header: ReportHeader | None = None,
    ) -> "JobParameters":
        """scan_accuracy_mm : of the scanner (1 sigma); it replaces that of the settings, None leaves it;
        acceptance : without limits for the whole part it has those of the tolerance
        """
        if scan_accuracy_mm is not None:
            changed = {"scan_accuracy_mm": scan_accuracy_mm}
            registration = settings.registration.model_copy(update=changed)
            settings = settings.model_copy(update={"registration": registration})
        if acceptance is not None:
            acceptance = acceptance.with_tolerance(tolerance_mm)
        if not limits_are_given(alignment, acceptance, tolerance_mm):
            raise ValueError("alignment: a tolerance_fit needs limits: its own, acceptance or tolerance_mm")
        return cls(settings, seed, tolerance_mm, acceptance, reference, alignment, header or ReportHeader())

    def max_sigma_mm(self, design_diagonal_mm: float) -> float:
        """How uncertain (1 sigma) a motion may be: the tolerance, or a share of the design's diagonal."""
        share = self.settings.registration.free_motion_share
        return share * design_diagonal_mm if self.tolerance_mm is None else self.tolerance_mm

    def residual_limit_mm(self, design_diagonal_mm: float) -> float:
        """Truncated RMS distance up to which a scan of the part may be `ok`: what prints warp, the scanner
        and the tolerance of the part leave, as independent contributions.
        """
        without_tolerance_mm = self.settings.registration.residual_limit_mm(design_diagonal_mm)
        return float((without_tolerance_mm**2 + (self.tolerance_mm or 0.0) ** 2) ** 0.5)
