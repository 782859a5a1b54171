"""The evidence for a pose in five numbers, and the probability that it is right (logistic regression)."""

from dataclasses import dataclass

import numpy as np

from pipeline.analysis.design_model import DesignModel
from pipeline.analysis.scan_registration import RegisteredScan
from pipeline.core.job_parameters import JobParameters
from pipeline.core.mesh import FloatArray
from pipeline.core.settings import RegistrationSettings
from pipeline.search.score_ratio import is_loose, required_ratio, score_ratio
from pipeline.search.types import Matching
from pipeline.stages.registration import Registration
from pipeline.verification.alternative_hypotheses import HypothesisChecks
from pipeline.verification.thresholds import CONFIDENCE, VERDICT


@dataclass(frozen=True, slots=True)
class Case:
    """What a verdict is about. scan_landmarks : how many the scan has; max_sigma_mm : how uncertain a motion
    may be (1 sigma)
    """

    registration: Registration
    matching: Matching
    checks: HypothesisChecks
    scan_landmarks: int
    diagonal_mm: float
    max_sigma_mm: float

    @classmethod
    def of(
        cls, registered: RegisteredScan, checks: HypothesisChecks, design: DesignModel, job: JobParameters
    ) -> "Case":
        registration = registered.registration
        count = len(registered.scan.landmarks.vertex)
        max_sigma_mm = job.max_sigma_mm(design.diagonal_mm)
        return cls(registration, registration.matching, checks, count, design.diagonal_mm, max_sigma_mm)

    @property
    def rms_mm(self) -> float:
        """Truncated RMS distance of the scan to the design."""
        return self.registration.fit.truncated_rms_mm

    def is_loose(self, settings: RegistrationSettings) -> bool:
        return is_loose(self.rms_mm, self.diagonal_mm, settings)

    def alternative_ratios(self) -> list[float]:
        """Score ratios of the poses that are no symmetry of the design, lowest first."""
        best = self.registration.best.score_mm2
        pairs = zip(self.registration.alternatives, self.checks.symmetric, strict=True)
        return sorted(
            score_ratio(pose.score_mm2, best, self.diagonal_mm) for pose, symmetric in pairs if not symmetric
        )

    def has_close_alternative(self, settings: RegistrationSettings) -> bool:
        """Whether a pose that is no symmetry scores less than the margin times the best."""
        required = required_ratio(self.rms_mm, self.diagonal_mm, settings)
        return any(ratio < required for ratio in self.alternative_ratios())

    def mirror_fits_better(self) -> bool:
        """Whether the mirrored scan leaves clearly less."""
        mirrored_mm = self.checks.mirrored_rms_mm
        return mirrored_mm is not None and mirrored_mm < VERDICT.mirror_better_ratio * self.rms_mm


def evidence(case: Case, settings: RegistrationSettings) -> FloatArray:
    """(5,) the evidence for the best pose, whatever the status.

    log of the score ratio of the best alternative that is no symmetry, at most `max_lead`, which stands for
    none; residual over its limit, at most `max_residual`; fitness; log10 of the design's coverage, at least
    that of `min_coverage`; share of the scan's landmarks that are matched.
    """
    registration = case.registration
    ratios = case.alternative_ratios()
    lead = float(np.log(ratios[0])) if ratios else CONFIDENCE.max_lead
    limit_mm = settings.max_residual_share * case.diagonal_mm
    return np.array(
        [
            min(max(lead, 0.0), CONFIDENCE.max_lead),
            min(case.rms_mm / limit_mm, CONFIDENCE.max_residual),
            registration.fit.fitness,
            np.log10(max(registration.design_coverage, CONFIDENCE.min_coverage)),
            len(case.matching.scan) / max(1, case.scan_landmarks),
        ]
    )


def probability(weights: FloatArray, evidence: FloatArray) -> float:
    """Logistic function of weights[0] + weights[1:] @ evidence."""
    return float(1.0 / (1.0 + np.exp(-(weights[0] + weights[1:] @ evidence))))


def confidence(case: Case, settings: RegistrationSettings, *, count_ties: bool) -> float:
    """Probability in [0, 1] that the best pose is right, up to symmetries and unconstrained motions.

    count_ties : at most the probability of a guess among equal scores; False where a continuous motion is
    unconstrained, along which scores are equal by nature
    """
    weights = np.array([CONFIDENCE.intercept, *CONFIDENCE.weights])
    ties = sum(ratio <= VERDICT.tie_ratio for ratio in case.alternative_ratios()) if count_ties else 0
    return min(probability(weights, evidence(case, settings)), 1.0 / (1 + ties + case.mirror_fits_better()))
