"""May the pose be trusted? The first of these that applies, then what a person should know whatever the status.

`units_suspect` > `mirrored` > `no_match` > `under_constrained` > `ambiguous` > `ok`: each defined in `judge`.
"""

from dataclasses import dataclass

import numpy as np

from pipeline.core.mesh import FloatArray
from pipeline.core.results import Finding, Verdict, VerdictStatus
from pipeline.core.settings import RegistrationSettings
from pipeline.search import score_ratio as margin
from pipeline.stages.matching import Matching
from pipeline.stages.registration import Registration
from pipeline.verification.alternative_hypotheses import UNIT_FACTORS, Doubts

RIVAL_NOTE = 2.0  # a second pose with a score below this many times the best is worth a finding
WEAK_EIGENVALUE = 1e-3
MIRROR_BETTER = 0.9  # of the residual: a reflection that leaves less is told, and not `ok`
TIE = 1.05  # times the best score: nothing tells such poses apart
MOST_MARGIN = 2.0

#: Intercept and a weight for each of `evidence`, from `tests/accuracy/confidence.py`.
CONFIDENCE = np.array([0.74, 1.26, -1.89, 1.5, 0.25, 0.39])

#: With these there is a pose to stand by, as far as the status says.
POSED: frozenset[VerdictStatus] = frozenset({"ok", "units_suspect", "under_constrained", "ambiguous"})


@dataclass(frozen=True, slots=True)
class Case:
    """What a verdict is about. landmarks : of the scan; certain_mm : how uncertain a motion may be (one sigma)"""

    registration: Registration
    matching: Matching
    doubts: Doubts
    landmarks: int
    diagonal_mm: float
    certain_mm: float


def judge(case: Case, settings: RegistrationSettings) -> Verdict:
    """The verdict of design section 4.

    units_suspect : the scan fits after its numbers are multiplied by a unit factor, and not without;
    mirrored : the reflected scan leaves less than `mirror_gain` of the residual, and fits;
    no_match : too little of the scan lies on the design (`min_fitness`), or too far off it (`max_residual_share`);
    under_constrained : a motion of the scan is less certain than the tolerance, or `free_motion_share` of the diagonal;
    ambiguous : another pose, no symmetry of the design, scores less than `rival_margin` times the best; less than
    `margin.LOOSE_MARGIN` times where the best itself fits loosely;
    or the reflected scan fits better (`MIRROR_BETTER`), though not by so much that it must be the mirror image.

    confidence : the probability that the pose is right, up to symmetries and free motions, by `evidence` and `CONFIDENCE`;
    at most that of a guess among equal scores; 0 without a pose.
    """
    findings = _misfit(case, settings)
    matched = not findings
    status: VerdictStatus = "ok"
    mirrored = _mirrored(case, settings)
    if case.doubts.unit_factor is not None:
        status = "units_suspect"
        findings.insert(0, _units(case.doubts.unit_factor))
    elif mirrored is not None:
        status = "mirrored"
        findings.insert(0, mirrored)
    elif not matched:
        status = "no_match"
    elif case.registration.observability.unconstrained:
        status = "under_constrained"
    elif _has_rival(case, settings) or _mirror_fits_better(case):
        status = "ambiguous"
    if matched:
        findings += [*_looseness(case, settings), *_handedness(case, status)]
    findings += [*_free(case), *_rivals(case), *_weakness(case)]
    confidence = probability(CONFIDENCE, evidence(case, settings)) if status in POSED else 0.0
    equals = 0 if status == "under_constrained" else sum(ratio <= TIE for ratio in _others(case))
    confidence = min(confidence, 1.0 / (1 + equals + _mirror_fits_better(case)))
    return Verdict(status=status, confidence=confidence, findings=findings)


def evidence(case: Case, settings: RegistrationSettings) -> FloatArray:
    """(5,) what speaks for the best pose, whatever the status.

    log(score of the next pose that is no symmetry / best), at most 2 and 2 without one; residual over its limit, at most 3;
    fitness; log10 of the design's coverage, at least -3; share of the scan's landmarks that are matched.
    """
    registration = case.registration
    others = _others(case)
    ahead = float(np.log(others[0])) if others else MOST_MARGIN
    limit_mm = settings.max_residual_share * case.diagonal_mm
    return np.array(
        [
            min(max(ahead, 0.0), MOST_MARGIN),
            min(registration.fit.truncated_rms_mm / limit_mm, 3.0),
            registration.fit.fitness,
            np.log10(max(registration.design_coverage, 1e-3)),
            len(case.matching.scan) / max(1, case.landmarks),
        ]
    )


def probability(weights: FloatArray, evidence: FloatArray) -> float:
    """Logistic: weights[0] is the intercept."""
    return float(1.0 / (1.0 + np.exp(-(weights[0] + weights[1:] @ evidence))))


def _misfit(case: Case, settings: RegistrationSettings) -> list[Finding]:
    fit, findings = case.registration.fit, []
    limit_mm = settings.max_residual_share * case.diagonal_mm
    inlier_mm = case.registration.inlier_distance_mm
    if fit.fitness < settings.min_fitness:
        near = f"{fit.fitness:.0%} of the scan lies within {inlier_mm:.3g} mm of the design"
        detail = f"{near}; {settings.min_fitness:.0%} are needed"
        findings.append(Finding(code="low_fitness", detail=detail, value=fit.fitness))
    coverage = case.registration.design_coverage
    if coverage < settings.min_coverage:
        detail = f"the scan shows {coverage:.1%} of the design; {settings.min_coverage:.0%} are needed"
        findings.append(Finding(code="low_coverage", detail=detail, value=coverage))
    if fit.truncated_rms_mm > limit_mm:
        detail = (
            f"the scan is {fit.truncated_rms_mm:.3g} mm off the design (RMS, each distance counted as at most "
            f"{inlier_mm:.3g} mm); up to {limit_mm:.3g} mm count as the same part"
        )
        findings.append(Finding(code="high_residual", detail=detail, value=fit.truncated_rms_mm))
    return findings


def _units(factor: float) -> Finding:
    detail = (
        f"the scan fits only when its numbers are multiplied by {factor:.6g} ({UNIT_FACTORS[factor]}); transform and "
        "metrics are of the scan so scaled: say the unit in options.units and send it again"
    )
    return Finding(code="unit_factor", detail=detail, value=factor)


def _mirrored(case: Case, settings: RegistrationSettings) -> Finding | None:
    under, rigid_mm = case.doubts.mirrored_rms_mm, case.registration.fit.truncated_rms_mm
    limit_mm = settings.max_residual_share * case.diagonal_mm
    if under is None or under > limit_mm or under > settings.mirror_gain * rigid_mm:
        return None
    detail = (
        f"the mirror image of the scan lies {under:.3g} mm off the design (RMS), the scan itself {rigid_mm:.3g} mm: "
        "it was mirrored on export, or it is the part of the other side"
    )
    return Finding(code="mirrored", detail=detail, value=under)


def _mirror_fits_better(case: Case) -> bool:
    under, rigid_mm = case.doubts.mirrored_rms_mm, case.registration.fit.truncated_rms_mm
    return under is not None and under < MIRROR_BETTER * rigid_mm


def _handedness(case: Case, status: VerdictStatus) -> list[Finding]:
    under = case.doubts.mirrored_rms_mm
    if under is None or status == "mirrored" or not _mirror_fits_better(case):
        return []
    detail = (
        f"the mirror image of the scan lies {under:.3g} mm off the design (RMS), the scan itself "
        f"{case.registration.fit.truncated_rms_mm:.3g} mm: it may be the part of the other side"
    )
    return [Finding(code="mirror_fits_better", detail=detail, value=under)]


def _looseness(case: Case, settings: RegistrationSettings) -> list[Finding]:
    if not _is_loose(case, settings):
        return []
    rms_mm = case.registration.fit.truncated_rms_mm
    detail = (
        f"the scan is {rms_mm:.3g} mm off the design (RMS), more than a good scanner and printer leave: a rough scan, or a "
        "similar part; look at the aligned meshes"
    )
    return [Finding(code="loose_fit", detail=detail, value=rms_mm)]


def _is_loose(case: Case, settings: RegistrationSettings) -> bool:
    return margin.is_loose(case.registration.fit.truncated_rms_mm, case.diagonal_mm, settings)


def _free(case: Case) -> list[Finding]:
    return [
        Finding(
            code="free_motion",
            detail=f"a {motion.kind} about or along ({', '.join(f'{x:.3f}' for x in motion.axis)}) is known to "
            f"{motion.sigma_mm:.3g} mm only (one sigma; {case.certain_mm:.3g} mm are asked for)",
            value=motion.sigma_mm,
        )
        for motion in case.registration.observability.unconstrained
    ]


def _rivals(case: Case) -> list[Finding]:
    findings = []
    equal = sum(case.doubts.symmetric)
    if equal:
        detail = f"the design is its own image under {equal} of the alternatives: every such pose is as right as this one"
        findings.append(Finding(code="symmetric_design", detail=detail, value=float(equal)))
    others = _others(case)
    if others and others[0] < RIVAL_NOTE:
        detail = "another pose, no symmetry of the design, fits almost as well; see alternatives"
        findings.append(Finding(code="rival_pose", detail=detail, value=others[0]))
    return findings


def _weakness(case: Case) -> list[Finding]:
    findings, registration = [], case.registration
    weakest = float(registration.observability.eigenvalues[0])
    if weakest < WEAK_EIGENVALUE and not registration.observability.unconstrained:
        detail = "the surfaces hardly notice one of the six motions (a turn or a slide): check the pose"
        findings.append(Finding(code="weakly_constrained", detail=detail, value=weakest))
    if case.matching.T_landmarks is None:
        count = len(case.matching.design)
        detail = f"{count} landmarks match, too few to fix a pose by landmarks alone; it came from {registration.seed} hypotheses"
        findings.append(Finding(code="few_landmarks", detail=detail, value=float(count)))
    if not registration.best.converged:
        iterations = registration.best.iterations
        detail = f"ICP was still moving after {iterations} iterations"
        findings.append(Finding(code="not_converged", detail=detail, value=float(iterations)))
    return findings


def _others(case: Case) -> list[float]:
    """How many times the best the poses score that are no symmetry of the design, lowest first."""
    rivals, best = (
        zip(case.registration.rivals, case.doubts.symmetric, strict=True),
        case.registration.best.score_mm2,
    )
    return sorted(
        margin.ratio(rival.score_mm2, best, case.diagonal_mm) for rival, symmetric in rivals if not symmetric
    )


def _has_rival(case: Case, settings: RegistrationSettings) -> bool:
    """A pose that is no symmetry scores less than the margin times the best."""
    needed = margin.needed(case.registration.fit.truncated_rms_mm, case.diagonal_mm, settings)
    return any(ratio < needed for ratio in _others(case))
