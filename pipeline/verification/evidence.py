"""The evidence for a pose, and two probabilities that follow from it: that the scan is of this design, and
that the pose is right if it is.

Each probability is a logistic regression on a few named numbers (`thresholds.CONFIDENCE`).
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from pipeline.analysis.design_model import DesignModel
from pipeline.analysis.scan_registration import RegisteredScan
from pipeline.core.job_parameters import JobParameters
from pipeline.core.results import Evidence
from pipeline.core.settings import RegistrationSettings, Settings
from pipeline.kernels.strain import Strain
from pipeline.search.score_ratio import is_loose, required_ratio, score_ratio
from pipeline.search.types import Matching
from pipeline.stages.registration import Registration
from pipeline.verification.hypothesis_checks import HypothesisChecks
from pipeline.verification.placed_scan import PlacedScan
from pipeline.verification.scan_quality import ScannerQuality
from pipeline.verification.size_evidence import assess_size
from pipeline.verification.surface_evidence import SurfaceEvidence, assess_surfaces
from pipeline.verification.thresholds import CONFIDENCE, VERDICT, LogisticModel
from pipeline.verification.tight_fit import TightFit

#: What each piece of evidence measures, for people.
DETAILS = {
    "residual": "RMS distance of the scan to the design beyond what the scanner explains, over 0.9 % of the "
    "diagonal (log10)",
    "detail": "difference of shape: RMS over patches of the signed distance without smooth distortion, over "
    "0.2 % of the diagonal and the scanner's accuracy (log10)",
    "normal_agreement": "mean cosine between the normals of scan and design; 0 beyond the inlier distance",
    "matched_landmarks": "share of the scan's landmarks that have their partner on the design",
    "lead": "score of the best other pose over that of this one (natural log, at most 2)",
    "distinct_lead": "score of the best other pose at which the design does not repeat itself over that of "
    "this one (natural log, at most 2)",
    "mirror": "residual of the mirrored scan over that of the scan (log10); 0: not tested",
    "coverage": "share of the design that the scan shows (log10)",
}


@dataclass(frozen=True, slots=True)
class Case:
    """What a verdict is about. strain : of the scan over the design, None where it is not determined;
    scan_landmarks : how many the scan has; max_sigma_mm : how uncertain a motion may be (1 sigma);
    is_fitted : whether the settings are those that the models were fitted with
    """

    registration: Registration
    matching: Matching
    checks: HypothesisChecks
    surfaces: SurfaceEvidence
    strain: Strain | None
    quality: ScannerQuality
    scan_landmarks: int
    diagonal_mm: float
    max_sigma_mm: float
    is_fitted: bool

    @classmethod
    def of(
        cls,
        registered: RegisteredScan,
        checks: HypothesisChecks,
        quality: ScannerQuality,
        design: DesignModel,
        job: JobParameters,
    ) -> "Case":
        registration, scan = registered.registration, registered.scan
        placed = PlacedScan(
            scan.mesh,
            registration.fit,
            registration.best.normal_sign,
            scan.resampled.mesh,
            scan.resampled.working_of_clean,
            registration.scan_surface,
            stations=None if registration.ignored_stations else scan.stations,
        )
        surfaces = assess_surfaces(
            placed,
            design.surface,
            design.analysis.resampled.mesh,
            registration.inlier_distance_mm,
            quality.accuracy_mm or 0.0,
        )
        return cls(
            registration=registration,
            matching=registration.matching,
            checks=checks,
            surfaces=surfaces,
            strain=assess_size(
                scan.mesh, registration.fit, design.surface, registration.inlier_distance_mm, job.seed
            ),
            quality=quality,
            scan_landmarks=len(registered.scan.landmarks.vertex),
            diagonal_mm=design.diagonal_mm,
            max_sigma_mm=job.max_sigma_mm(design.diagonal_mm),
            is_fitted=holds_for(job.settings),
        )

    @property
    def rms_mm(self) -> float:
        """Truncated RMS distance of the scan to the design."""
        return self.registration.fit.truncated_rms_mm

    @property
    def tight_fit(self) -> TightFit:
        """How the scan fits, beside the evidence."""
        return TightFit(self.rms_mm, self.surfaces, self.strain, self.quality, self.diagonal_mm)

    def is_loose(self, settings: RegistrationSettings) -> bool:
        return is_loose(self.rms_mm, self.diagonal_mm, settings)

    def alternative_ratios(self) -> list[float]:
        """Score ratios of the poses that are no symmetry of the design, lowest first."""
        return self._ratios(self.checks.symmetric)

    def distinct_ratios(self) -> list[float]:
        """Those of `alternative_ratios` at which the design does not repeat itself, lowest first."""
        symmetric, repeats = self.checks.symmetric, self.checks.repeats
        if repeats is None:
            return self._ratios(symmetric)
        return self._ratios(tuple(a or b for a, b in zip(symmetric, repeats, strict=True)))

    def _ratios(self, is_left_out: tuple[bool, ...]) -> list[float]:
        best = self.registration.best.score_mm2
        pairs = zip(self.registration.alternatives, is_left_out, strict=True)
        return sorted(
            score_ratio(pose.score_mm2, best, self.diagonal_mm) for pose, left_out in pairs if not left_out
        )

    def has_close_alternative(self, settings: RegistrationSettings) -> bool:
        """Whether a pose that is no symmetry scores less than the margin times the best.

        A scanner that is as inaccurate as a loose fit asks for the margin of one, however well the scan fits:
        its distortion may well favour the wrong pose.
        """
        left_mm = max(self.rms_mm, self.quality.accuracy_mm or 0.0)
        required = required_ratio(left_mm, self.diagonal_mm, settings)
        return any(ratio < required for ratio in self.alternative_ratios())

    def mirror_fits_better(self) -> bool:
        """Whether the mirrored scan leaves clearly less, and not only of smooth distortion: on a part that is
        nearly its own mirror image a warp may fit either better.
        """
        mirrored = self.checks.mirrored
        if mirrored is None or mirrored.rms_mm >= VERDICT.mirror_better_ratio * self.rms_mm:
            return False
        return mirrored.detail_mm is None or mirrored.detail_mm <= self.surfaces.detail_mm


def holds_for(settings: Settings) -> bool:
    """Whether nothing that changes the evidence is set otherwise: the working mesh, the landmarks and how
    they are matched, and how far a match may lie.
    """
    default = Settings()
    return (
        settings.resample.enabled == default.resample.enabled
        and settings.landmarks == default.landmarks
        and settings.matching.length_share == default.matching.length_share
        and settings.registration.inlier_share == default.registration.inlier_share
    )


def evidence(case: Case) -> dict[str, float]:
    """Each piece of evidence by name, as described in `DETAILS`; the same whatever the status."""
    mirrored_mm = None if case.checks.mirrored is None else case.checks.mirrored.rms_mm
    ratios, matched = case.alternative_ratios(), len(case.matching.scan)
    values = surface_values(case.rms_mm, case.surfaces, case.quality, case.diagonal_mm)
    values |= rival_values(
        ratios, case.distinct_ratios(), mirrored_mm, case.rms_mm, matched, case.scan_landmarks
    )
    return values | {
        "coverage": log_coverage(case.registration.design_coverage),
    }


def surface_values(
    rms_mm: float, surfaces: SurfaceEvidence, quality: ScannerQuality, diagonal_mm: float
) -> dict[str, float]:
    """`residual`, `detail` and `normal_agreement` of one pose."""
    unexplained_mm = float(np.sqrt(max(0.0, rms_mm**2 - quality.explained_mm**2)))
    detail_unit_mm = float(np.hypot(CONFIDENCE.detail_unit_share * diagonal_mm, quality.explained_mm))
    return {
        "residual": _log10(unexplained_mm / (CONFIDENCE.residual_unit_share * diagonal_mm)),
        "detail": _log10(surfaces.detail_mm / detail_unit_mm),
        "normal_agreement": surfaces.normal_agreement,
    }


def rival_values(
    ratios: list[float],
    distinct: list[float],
    mirrored_mm: float | None,
    rms_mm: float,
    matched: int,
    scan_landmarks: int,
) -> dict[str, float]:
    """`lead`, `distinct_lead`, `mirror` and `matched_landmarks` of one pose. ratios, distinct : score ratios
    of other poses, and of those at which the design does not repeat itself, lowest first; mirrored_mm :
    residual of the reflected scan, None where it was not tested
    """
    return {
        "matched_landmarks": matched / max(1, scan_landmarks),
        "lead": _lead(ratios),
        "distinct_lead": _lead(distinct),
        "mirror": 0.0 if mirrored_mm is None else _mirror(mirrored_mm, rms_mm),
    }


def log_coverage(coverage: float) -> float:
    """`coverage` from the share of the design that the scan shows."""
    return float(np.log10(max(coverage, CONFIDENCE.min_coverage)))


def probability(model: LogisticModel, values: Mapping[str, float]) -> float:
    """Of one model, given the values by name."""
    total = sum(weight * values[name] for name, weight in zip(model.names, model.weights, strict=True))
    return float(1.0 / (1.0 + np.exp(-(model.intercept + total))))


def same_part(case: Case) -> float:
    """Probability in [0, 1] that the scan is of this design."""
    return probability(CONFIDENCE.same_part, evidence(case))


def same_part_whatever_repeats(case: Case) -> float:
    """As `same_part`, with every other pose counted against it: that a design repeats itself excuses a second
    pose, and is no evidence for the part.
    """
    values = evidence(case)
    return probability(CONFIDENCE.same_part, values | {"distinct_lead": values["lead"]})


def pose(case: Case, *, count_ties: bool) -> float:
    """Probability in [0, 1] that the pose is right if the part is, up to symmetries and free motions.

    count_ties : at most the probability of a guess among equal scores; False where a continuous motion is
    unconstrained, along which scores are equal by nature. The mirrored scan, where it fits better, and a
    flat, which fits elsewhere too, count as one more
    """
    ties = sum(ratio <= VERDICT.tie_ratio for ratio in case.alternative_ratios()) if count_ties else 0
    guess = 1.0 / (1 + ties + case.mirror_fits_better() + case.tight_fit.is_flat)
    return min(probability(CONFIDENCE.pose, evidence(case)), guess)


def evidence_records(case: Case) -> list[Evidence]:
    """Every piece of evidence of both models, as the results show it."""
    values = evidence(case)
    models = (("same_part", CONFIDENCE.same_part), ("pose", CONFIDENCE.pose))
    return [
        Evidence(
            name=name,
            of=of,
            value=values[name],
            weight=weight,
            contribution=weight * (values[name] - typical),
            detail=DETAILS[name],
        )
        for of, model in models
        for name, weight, typical in zip(model.names, model.weights, model.typical, strict=True)
    ]


def _lead(ratios: list[float]) -> float:
    lead = float(np.log(ratios[0])) if ratios else CONFIDENCE.max_lead
    return min(max(lead, 0.0), CONFIDENCE.max_lead)


def _mirror(mirrored_mm: float, rms_mm: float) -> float:
    limit = CONFIDENCE.max_mirror_log10
    return float(np.clip(np.log10(max(mirrored_mm, 1e-12) / max(rms_mm, 1e-12)), -limit, limit))


def _log10(ratio: float) -> float:
    return float(np.clip(np.log10(max(ratio, 1e-12)), CONFIDENCE.min_log10, CONFIDENCE.max_log10))
