"""The decision on a part: `pass`, `fail` or `not_judged`, with its reasons."""

from dataclasses import replace

import numpy as np

from pipeline.analysis.design_model import DesignModel
from pipeline.core.acceptance import Acceptance
from pipeline.core.results import Verdict
from pipeline.core.results.inspection import Check, Decision, Inspection
from pipeline.core.sentences import place, sentence
from pipeline.inspection.checks import Part, checks_of
from pipeline.inspection.extremes import extremes
from pipeline.inspection.limits_check import rule
from pipeline.inspection.measured_surface import MeasuredSurface
from pipeline.inspection.patches import default_diameter_mm, patches
from pipeline.inspection.pose_error import PoseError
from pipeline.kernels.correlated_noise import noise_of
from pipeline.kernels.surface_patches import adjacency_of
from pipeline.stages.deviation import Deviations
from pipeline.stages.registration import Registration
from pipeline.verification.thresholds import VERDICT

#: Findings (`verification.findings`) of the shape of the part, and those beside which a pose is not sure.
SHAPE_DIFFERENCES = frozenset({"missing_material", "local_difference"})
OTHER_DOUBTS = frozenset(
    {"high_residual", "flat_scan", "accuracy_unknown", "accuracy_too_coarse", "scan_more"}
)
NO_LIMITS = sentence("no acceptance limits were stated (options.acceptance), so the part is not judged")


def inspect(
    registration: Registration,
    deviations: Deviations,
    seen: float | None,
    design: DesignModel,
    verdict: Verdict,
    acceptance: Acceptance | None,
    alignment_problem: str | None = None,
    pose_error: PoseError | None = None,
) -> Inspection:
    """Check a registered scan against its limits. seen : share of the design's area that the scan shows, by
    the design's vertices;
    alignment_problem : why the alignment asked for was not made; pose_error : how well it is known

    A part passes only when the verdict is `ok`, there is at least one check, and all pass. It fails only when
    the pose is sure (`pose_is_sure`): under one that may be wrong, deviations say nothing about the part.

    Raises
    ------
    UnknownRegion, PointOffSurface
    """
    surface = MeasuredSurface.of(registration, deviations, design)
    diameter_mm = None if acceptance is None else acceptance.patch_mm
    diameter_mm = diameter_mm or default_diameter_mm(surface, design.diagonal_mm)
    inflation = noise_of(surface.foot_mm, surface.normal, surface.signed_mm, diameter_mm).inflation()
    found = patches(surface, diameter_mm, inflation)
    if pose_error is not None:
        of_pose_mm = pose_error.at(surface.place_mm, surface.place_normal)
        found = replace(found, error_mm=np.hypot(found.error_mm, of_pose_mm))
    if len(surface.place_mm) > len(design.analysis.mesh.vertices) and registration.scan_surface is not None:
        seen = surface.seen()  # a CAD file has vertices at its corners only, which say little of its faces
    part = Part(surface, found, design.surface, seen, verdict, inflation, pose_error)
    checks = [] if acceptance is None else checks_of(part, acceptance)
    decision, reasons = decide(verdict, checks, acceptance, alignment_problem)
    return Inspection(
        decision=decision,
        reasons=reasons,
        rule=None if acceptance is None else rule(acceptance),
        patch_mm=found.diameter_mm,
        checks=checks,
        extremes=extremes(surface, found, adjacency_of(design.analysis.resampled.mesh)),
    )


def without_pose(verdict: Verdict, acceptance: Acceptance | None) -> Inspection:
    """The inspection of a scan without a valid alignment, where nothing can be measured."""
    decision, reasons = decide(verdict, [], acceptance)
    return Inspection(
        decision=decision,
        reasons=reasons,
        rule=None if acceptance is None else rule(acceptance),
        patch_mm=None,
        checks=[],
        extremes=[],
    )


def decide(
    verdict: Verdict,
    checks: list[Check],
    acceptance: Acceptance | None,
    alignment_problem: str | None = None,
) -> tuple[Decision, list[str]]:
    """The decision and why, for people. Under another alignment than the one asked for nothing is judged."""
    if alignment_problem is not None:
        return "not_judged", [
            sentence(
                "the alignment of options.alignment was not applied, so the part is not judged: {why}",
                why=alignment_problem,
            )
        ]
    reasons = [words(check) for check in checks if check.passed is not True]
    if acceptance is not None and pose_is_sure(verdict) and any(check.passed is False for check in checks):
        return "fail", reasons
    if verdict.status != "ok":
        why = sentence(
            "the alignment is {status}, so the part is not judged", status=verdict.status.replace("_", " ")
        )
        return "not_judged", [why, *reasons]
    if acceptance is None or not checks:
        return "not_judged", [NO_LIMITS]
    return ("not_judged", reasons) if reasons else ("pass", [])


def pose_is_sure(verdict: Verdict) -> bool:
    """Whether deviations are of the part: the verdict is `ok`, or `uncertain` for nothing but a place where
    the part differs from its design (a burr, a piece that broke off), with both probabilities as `ok` asks.
    """
    if verdict.status != "uncertain":
        return verdict.status == "ok"
    codes = {finding.code for finding in verdict.findings}
    return (
        bool(codes & SHAPE_DIFFERENCES)
        and not codes & OTHER_DOUBTS
        and (verdict.same_part or 0.0) >= VERDICT.ok_same_part
        and (verdict.pose or 0.0) >= VERDICT.ok_pose
    )


def words(check: Check) -> str:
    """Why a check did not pass."""
    if check.value is None and check.kind == "confidence":
        return sentence("confidence: none is given with these settings; see the findings of the verdict")
    if check.value is None:
        return sentence("{check}: not measured, because the scan has too few points there", check=check.name)
    limit = check.upper if check.upper is not None and check.value > _middle(check) else check.lower
    side = "above" if limit == check.upper else "below"
    found = {
        "check": check.name,
        "value": _shown(check.value, check.unit),
        "limit": _shown(limit, check.unit),
    }
    if check.passed is None:
        return sentence(
            "{check}: {value} is nearer to its limit of {limit} than the stated uncertainty, so it "
            "neither passes nor fails",
            **found,
        )
    if check.kind == "distance":
        return sentence(
            "{check}: the deviation from its nominal length, {value}, is {side} its limit of {limit}",
            side=side,
            **found,
        )
    if check.position_mm is None:
        return sentence("{check}: {value} is {side} its limit of {limit}", side=side, **found)
    return sentence(
        "{check}: the deviation of {value} is {side} its limit of {limit}, at {place} mm in the frame "
        "of the design",
        side=side,
        place=place(check.position_mm),
        **found,
    )


def _middle(check: Check) -> float:
    """Between the limits; values above it are compared with the upper one in words."""
    if check.lower is None or check.upper is None:
        return float("-inf")
    return (check.lower + check.upper) / 2


def _shown(value: float | None, unit: str) -> str:
    if value is None:
        return "-"
    return sentence("{value:.1%}", value=value) if unit == "1" else sentence("{value:.3f} mm", value=value)
