"""Which answers of a quality check are right for a variant, given the noise of the scan."""

from collections.abc import Collection
from dataclasses import dataclass

from tests.support.variants.record import Scope, Variant

#: A difference is visible from this multiple of the noise (1 sigma of a scan's point) on, by definition. One
#: point that far off is no chance; and a patch averages many.
VISIBLE_PER_NOISE = 4.0
#: Area of the patch, at least, share of the design's area: ten points of a scan of 10,000.
VISIBLE_PATCH_SHARE = 0.001
#: A mirror image that visibly differs on no more than this share of the area is a local change too: the rest
#: of the surface, nearly symmetric, is in place.
LOCAL_MIRROR_SHARE = 0.1
#: A difference within this factor of what is visible is borderline: no verdict on it is a fault.
BORDERLINE_FACTOR = 1.5

#: Findings, one of which has to come with `ok` on a part with a visible local change.
FINDINGS = frozenset({"missing_material", "local_difference"})
HEDGED = frozenset({"uncertain", "ambiguous", "under_constrained"})


@dataclass(frozen=True, slots=True)
class Expected:
    """statuses : that are right; needs_finding : `ok` is right only with one of `FINDINGS`; is_visible : the
    difference can be seen; is_borderline : it is close to what can be seen
    """

    statuses: frozenset[str]
    needs_finding: bool
    is_visible: bool
    is_borderline: bool

    def accepts(self, status: str, finding_codes: Collection[str] = ()) -> bool:
        """Whether the answer is right."""
        if status not in self.statuses:
            return False
        return status != "ok" or not self.needs_finding or not FINDINGS.isdisjoint(finding_codes)


def is_visible(variant: Variant, noise_mm: float) -> bool:
    """Whether the difference exceeds `VISIBLE_PER_NOISE` times the noise, on a patch of the least area."""
    limit_mm = VISIBLE_PER_NOISE * noise_mm
    patch = variant.difference.share_above(limit_mm)
    return variant.difference_max_mm > limit_mm and patch >= VISIBLE_PATCH_SHARE


def expected(variant: Variant, noise_mm: float) -> Expected:
    """A variant that differs by less than the noise can show must not be `no_match`; one that differs by more
    must not be `ok` without a finding, nor with one where it differs everywhere.

    noise_mm : 1 sigma of the scan's deviations from the part, with those of its warp
    """
    visible = is_visible(variant, noise_mm)
    borderline = is_visible(variant, noise_mm / BORDERLINE_FACTOR) != is_visible(
        variant, noise_mm * BORDERLINE_FACTOR
    )
    is_mirrored = variant.scope is Scope.MIRRORED
    if not visible:
        statuses = HEDGED | {"ok"} | ({"mirrored"} if is_mirrored else set())
        return Expected(frozenset(statuses), False, visible, borderline)
    is_local = variant.scope is Scope.LOCAL or (
        is_mirrored and variant.difference.share_above(VISIBLE_PER_NOISE * noise_mm) <= LOCAL_MIRROR_SHARE
    )
    statuses = HEDGED | {"no_match"}
    if is_local:
        statuses |= {"ok"}
    if is_mirrored:
        statuses |= {"mirrored"}
    elif not is_local:
        statuses |= {"mirrored", "units_suspect"}
    return Expected(frozenset(statuses), is_local, visible, borderline)
