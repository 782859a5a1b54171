"""What a registration computed, before any record or file is made of it."""

from dataclasses import dataclass

from pipeline.analysis.design_model import DesignModel
from pipeline.analysis.inputs import InputMesh
from pipeline.analysis.scan_registration import RegisteredScan
from pipeline.core.results import DesignDeviation, Inspection, Verdict
from pipeline.inspection.alignment import Aligned
from pipeline.stages.deviation import Deviations
from pipeline.stages.scale import ScaleDiagnosis
from pipeline.verification.hypothesis_checks import HypothesisChecks
from pipeline.verification.scan_quality import ScannerQuality
from pipeline.verification.verdict import HAS_POSE
from pipeline.workflows.alternative_records import AlternativePose


@dataclass(frozen=True, slots=True)
class RegistrationOutcome:
    """Everything that was computed. input_scan : the scan as read, without stray pieces; registered : the
    scan on the design as it fits best, in mm; aligned : the same as `options.alignment` wants it; of_design
    : distances of the design to the scan, scale : size of the scan over that of the design, both None
    without a pose; alternatives : the other poses that are reported; inspection : of the part
    """

    design: DesignModel
    input_scan: InputMesh
    registered: RegisteredScan
    aligned: Aligned
    quality: ScannerQuality
    checks: HypothesisChecks
    verdict: Verdict
    deviations: Deviations
    of_design: DesignDeviation | None
    scale: ScaleDiagnosis | None
    alternatives: tuple[AlternativePose, ...]
    inspection: Inspection

    @property
    def has_pose(self) -> bool:
        return self.verdict.status in HAS_POSE
