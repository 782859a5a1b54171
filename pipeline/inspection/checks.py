"""The checks of a part: every characteristic that has limits, measured and compared with them."""

from dataclasses import dataclass

import numpy as np

from pipeline.core.acceptance import Acceptance, DistanceLimits, PointLimits, SurfaceLimits
from pipeline.core.mesh import BoolArray, FloatArray
from pipeline.core.results import Verdict
from pipeline.core.results.inspection import Check, CheckKind
from pipeline.inspection import regions
from pipeline.inspection.limits_check import passes
from pipeline.inspection.measured_surface import MeasuredSurface
from pipeline.inspection.patches import Patches
from pipeline.inspection.points import MeasuredPoint, measured_point, off_nominal
from pipeline.kernels.surface import Surface


@dataclass(frozen=True, slots=True)
class Part:
    """What is checked. seen : share of the design's area that the scan shows, None if unknown"""

    surface: MeasuredSurface
    patches: Patches
    design: Surface
    seen: float | None
    verdict: Verdict


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
    measured = {each.name: measured_point(each, surface, part.design) for each in acceptance.points}
    found += [_of_point(measured[each.name], each, acceptance) for each in acceptance.points]
    return found + [_of_distance(each, measured, acceptance) for each in acceptance.distances]


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
        inside = np.ones(len(surface.signed_mm), dtype=np.bool_)
        if limits.lower is not None:
            inside &= surface.signed_mm >= limits.lower
        if limits.upper is not None:
            inside &= surface.signed_mm <= limits.upper
        area, n = float(surface.area[feet].sum()), int(feet.sum())
        share = float(surface.area[feet & inside].sum()) / area if area > 0 else None
        found.append(
            Check(
                name=f"{prefix}within",
                kind="within",
                region=region,
                value=None if share is None else min(1.0, share),
                lower=limits.min_within,
                upper=None,
                unit="1",
                uncertainty=None if share is None else float(np.sqrt(max(0.0, share * (1 - share)) / n)),
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
        value, error, n = float(value_mm[top]), float(part.patches.error_mm[top]), int(part.patches.n[top])
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


def _of_point(point: MeasuredPoint, limits: PointLimits, acceptance: Acceptance) -> Check:
    value = point.value
    return Check(
        name=limits.name,
        kind="point",
        region=None,
        value=None if value is None else value.median_mm,
        lower=limits.lower,
        upper=limits.upper,
        unit="mm",
        uncertainty=None if value is None else value.error_mm,
        n=None if value is None else value.n,
        passed=passes(
            None if value is None else value.median_mm,
            limits.lower,
            limits.upper,
            acceptance.uncertainty_mm,
        ),
        position_mm=point.position_mm.tolist(),
    )


def _of_distance(limits: DistanceLimits, measured: dict[str, MeasuredPoint], acceptance: Acceptance) -> Check:
    value, error, n = off_nominal(limits, measured) or (None, None, None)
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
