"""The checks of a part: every characteristic that has limits, measured and compared with them."""

from dataclasses import dataclass

import numpy as np
from scipy import stats

from pipeline.core.acceptance import Acceptance, DistanceLimits, PointLimits, SurfaceLimits
from pipeline.core.mesh import BoolArray, FloatArray
from pipeline.core.results import Verdict
from pipeline.core.results.inspection import Check, CheckKind
from pipeline.inspection import regions
from pipeline.inspection.limits_check import passes
from pipeline.inspection.measured_surface import MeasuredSurface
from pipeline.inspection.patches import Patches
from pipeline.inspection.points import MeasuredPoint, measured_point, off_nominal
from pipeline.inspection.pose_error import PoseError
from pipeline.kernels.surface import Surface

#: Patches whose value is nearer to the most extreme one than so many of its standard errors could be it as
#: well. Chosen by hand.
NEAR_ERRORS = 2.0


@dataclass(frozen=True, slots=True)
class Part:
    """What is checked. seen : share of the design's area that the scan shows, None if unknown; inflation :
    as in `patches.median_of`; pose_error : of the alignment, None where it is not known
    """

    surface: MeasuredSurface
    patches: Patches
    design: Surface
    seen: float | None
    verdict: Verdict
    inflation: float = 1.0
    pose_error: PoseError | None = None


def checks_of(part: Part, acceptance: Acceptance) -> list[Check]:
    """Coverage and confidence, the whole part, each region, each point, each distance.

    Raises
    ------
    UnknownRegion, PointOffSurface
    """
    found = [*_of_the_whole(part, acceptance)]
    surface, own_feet, own_places = part.surface, _none(part.surface.foot_mm), _none(part.surface.place_mm)
    on_design = (surface.segment_of_face, part.design, surface.brep)
    of_regions: list[Check] = []
    for each in acceptance.regions:
        feet = regions.members(each.region, each.name, surface.foot_mm, surface.face, *on_design)
        places = regions.members(each.region, each.name, surface.place_mm, surface.place_face, *on_design)
        own_feet |= feet
        own_places |= places
        of_regions += _of_surface(part, each, each.name, feet, places, acceptance)
    found += _of_surface(part, acceptance, None, ~own_feet, ~own_places, acceptance)
    found += of_regions
    measured = {
        each.name: measured_point(each, surface, part.design, part.inflation) for each in acceptance.points
    }
    found += [_of_point(part, measured[each.name], each, acceptance) for each in acceptance.points]
    return found + [_of_distance(part, each, measured, acceptance) for each in acceptance.distances]


def _none(points: FloatArray) -> BoolArray:
    return np.zeros(len(points), dtype=np.bool_)


def _of_the_whole(part: Part, acceptance: Acceptance) -> list[Check]:
    found = []
    kinds: tuple[tuple[CheckKind, float | None, float | None], ...] = (
        ("coverage", part.seen, acceptance.min_coverage),
        ("confidence", part.verdict.confidence, acceptance.min_confidence),
    )
    for kind, value, least in kinds:
        if least is not None:
            found.append(
                Check(
                    name=kind,
                    kind=kind,
                    region=None,
                    value=value,
                    lower=least,
                    upper=None,
                    unit="1",
                    uncertainty=None,
                    n=None,
                    passed=passes(value, least, None, None),
                    position_mm=None,
                )
            )
    return found


def _of_surface(
    part: Part,
    limits: SurfaceLimits,
    region: str | None,
    feet: BoolArray,
    places: BoolArray,
    acceptance: Acceptance,
) -> list[Check]:
    """feet, places : which scan vertices and which places of the design are meant"""
    surface, found = part.surface, []
    prefix = "" if region is None else f"{region}: "
    if limits.min_within is not None:
        n, share = int(feet.sum()), _share_within(surface.signed_mm[feet], surface.area[feet], limits)
        found.append(
            Check(
                name=f"{prefix}within",
                kind="within",
                region=region,
                value=None if share is None else min(1.0, share),
                lower=limits.min_within,
                upper=None,
                unit="1",
                uncertainty=None if share is None else _error_of_share(part, share, feet, limits),
                n=n,
                passed=passes(share, limits.min_within, None, None),
                position_mm=None,
            )
        )
    lower, upper = _of_patches(limits)
    if upper is not None:
        found.append(_of_extreme(part, "highest", prefix, region, places, (None, upper), acceptance))
    if lower is not None:
        found.append(_of_extreme(part, "lowest", prefix, region, places, (lower, None), acceptance))
    return found


def _share_within(signed_mm: FloatArray, area: FloatArray, limits: SurfaceLimits) -> float | None:
    """Of the area, what lies between the limits; None without any area."""
    inside = np.ones(len(signed_mm), dtype=np.bool_)
    if limits.lower is not None:
        inside &= signed_mm >= limits.lower
    if limits.upper is not None:
        inside &= signed_mm <= limits.upper
    total = float(area.sum())
    return float(area[inside].sum()) / total if total > 0 else None


def _error_of_share(part: Part, share: float, feet: BoolArray, limits: SurfaceLimits) -> float:
    """Standard error of a share of the area: of a share of so many independent vertices, and by how much it
    changes when the part moves by the standard error of its alignment.
    """
    variance = part.inflation * max(0.0, share * (1 - share)) / int(feet.sum())
    if part.pose_error is not None:
        surface = part.surface
        signed_mm, area = surface.signed_mm[feet], surface.area[feet]
        rows = part.pose_error.rows(surface.foot_mm[feet], surface.normal[feet])
        for motion in part.pose_error.principal_motions():
            moved_mm = np.einsum("ki,i->k", rows, motion)
            ends = [_share_within(signed_mm + side * moved_mm, area, limits) for side in (-1.0, 1.0)]
            variance += ((ends[1] or 0.0) - (ends[0] or 0.0)) ** 2 / 4
    return float(np.sqrt(variance))


def _of_patches(limits: SurfaceLimits) -> tuple[float | None, float | None]:
    """Limits that hold for every patch: those of the deviation unless a share of the area may be beyond, and
    the largest deviation.
    """
    own = (limits.lower, limits.upper) if limits.min_within is None else (None, None)
    most = limits.max_deviation_mm
    widest = (None, None) if most is None else (-most, most)
    lower = max((value for value in (own[0], widest[0]) if value is not None), default=None)
    upper = min((value for value in (own[1], widest[1]) if value is not None), default=None)
    return lower, upper


def _of_extreme(
    part: Part,
    kind: CheckKind,
    prefix: str,
    region: str | None,
    places: BoolArray,
    limits: tuple[float | None, float | None],
    acceptance: Acceptance,
) -> Check:
    lower, upper = limits
    value_mm = np.where(places, part.patches.value_mm, np.nan)
    known = np.isfinite(value_mm)
    value = error = n = position = None
    if known.any():
        sign = 1.0 if kind == "highest" else -1.0
        top = int(np.where(known, sign * value_mm, -np.inf).argmax())
        value, n = float(value_mm[top]), int(part.patches.n[top])
        error = float(part.patches.error_mm[top])
        error *= _of_choice(part, known & (sign * (value_mm[top] - value_mm) <= NEAR_ERRORS * error))
        position = part.surface.place_mm[top].tolist()
    return Check(
        name=f"{prefix}{kind}",
        kind=kind,
        region=region,
        value=value,
        lower=lower,
        upper=upper,
        unit="mm",
        uncertainty=error if error is not None and np.isfinite(error) else None,
        n=n,
        passed=passes(value, lower, upper, acceptance.uncertainty_mm),
        position_mm=position,
    )


def _of_choice(part: Part, near: BoolArray) -> float:
    """Factor of the standard error of the most extreme patch: it is the largest of several that are as
    extreme within their errors, and the largest of m equal values with noise lies beyond them by the expected
    maximum of m normal variables (Blom, "Statistical estimates and transformed beta-variables", 1958).

    near : (c,) the patches that are as extreme
    """
    a_patch_mm2 = np.pi * part.patches.diameter_mm**2 / 4
    m = max(1.0, float(part.surface.place_area_mm2[near].sum()) / a_patch_mm2)  # that share no vertex
    return float(np.hypot(1.0, stats.norm.ppf((m - 0.375) / (m + 0.25))))


def _of_point(part: Part, point: MeasuredPoint, limits: PointLimits, acceptance: Acceptance) -> Check:
    value, error = point.value, None
    if value is not None and value.error_mm is not None:
        error = value.error_mm
        if part.pose_error is not None:
            of_pose_mm = part.pose_error.at(point.position_mm[None], point.normal[None])
            error = float(np.hypot(error, of_pose_mm[0]))
    return Check(
        name=limits.name,
        kind="point",
        region=None,
        value=None if value is None else value.median_mm,
        lower=limits.lower,
        upper=limits.upper,
        unit="mm",
        uncertainty=error,
        n=None if value is None else value.n,
        passed=passes(
            None if value is None else value.median_mm,
            limits.lower,
            limits.upper,
            acceptance.uncertainty_mm,
        ),
        position_mm=point.position_mm.tolist(),
    )


def _of_distance(
    part: Part, limits: DistanceLimits, measured: dict[str, MeasuredPoint], acceptance: Acceptance
) -> Check:
    value, error, n = off_nominal(limits, measured, part.pose_error) or (None, None, None)
    return Check(
        name=limits.name,
        kind="distance",
        region=None,
        value=value,
        lower=limits.lower,
        upper=limits.upper,
        unit="mm",
        uncertainty=error,
        n=n,
        passed=passes(value, limits.lower, limits.upper, acceptance.uncertainty_mm),
        position_mm=None,
    )
