"""Does a scan fit as tightly as `ok` asks? The same measure for the scan, its mirror image and the scan in
another unit.
"""

from dataclasses import dataclass

from pipeline.kernels.strain import Strain
from pipeline.verification.scan_quality import ScannerQuality
from pipeline.verification.size_evidence import is_other_size, is_stretched
from pipeline.verification.surface_evidence import SurfaceEvidence
from pipeline.verification.thresholds import VERDICT


@dataclass(frozen=True, slots=True)
class TightFit:
    """What `ok` asks for beside the evidence for the part and the pose. rms_mm : truncated RMS distance;
    surfaces, strain : under the pose, strain None where it is not determined; diagonal_mm : of the design
    """

    rms_mm: float
    surfaces: SurfaceEvidence
    strain: Strain | None
    quality: ScannerQuality
    diagonal_mm: float

    @property
    def is_near(self) -> bool:
        """Whether the scan lies as near to the design as a scan of the part may."""
        return self.rms_mm <= self.quality.residual_limit_mm

    @property
    def is_alike(self) -> bool:
        """Whether the shapes differ in no place."""
        found = self.surfaces
        return found.scan_patch is None and found.design_patch is None and found.through_patch is None

    @property
    def is_stretched(self) -> bool:
        """Whether the scan is longer along one direction than along another."""
        return self.strain is not None and is_stretched(self.strain, self.quality.accuracy_mm or 0.0)

    @property
    def is_other_size(self) -> bool:
        """Whether the scan is larger or smaller as a whole."""
        return self.strain is not None and is_other_size(self.strain, self.quality.accuracy_mm or 0.0)

    @property
    def is_flat(self) -> bool:
        """Whether the scan is a flat piece, which fits on any flat."""
        noise_mm, flat_mm = self.quality.noise_mm or 0.0, VERDICT.flat_share * self.diagonal_mm
        return self.surfaces.thickness_mm <= max(VERDICT.flat_noises * noise_mm, flat_mm)

    @property
    def is_too_coarse(self) -> bool:
        """Whether the scanner, as stated, is too coarse to tell the part from a similar one."""
        return (self.quality.accuracy_mm or 0.0) > VERDICT.max_accuracy_share * self.diagonal_mm

    def holds(self) -> bool:
        is_of_size = not (self.is_stretched or self.is_other_size)
        return self.is_near and self.is_alike and is_of_size and not (self.is_flat or self.is_too_coarse)
