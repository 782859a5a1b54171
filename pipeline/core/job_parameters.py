"""What a registration job states beside its meshes."""

from dataclasses import dataclass

from pipeline.core.settings import Settings


@dataclass(frozen=True, slots=True)
class JobParameters:
    """settings; seed : of every random draw; tolerance_mm : of the part, None where the job states none"""

    settings: Settings
    seed: int
    tolerance_mm: float | None

    def max_sigma_mm(self, design_diagonal_mm: float) -> float:
        """How uncertain (1 sigma) a motion may be: the tolerance, or a share of the design's diagonal."""
        share = self.settings.registration.free_motion_share
        return share * design_diagonal_mm if self.tolerance_mm is None else self.tolerance_mm
