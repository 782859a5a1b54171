"""When a mirrored scan casts doubt on the handedness of a scan: not where it only fits a warp better."""

from types import SimpleNamespace
from typing import cast

import pytest

from pipeline.verification.evidence import Case
from pipeline.verification.hypothesis_checks import MirrorCheck


def case_of(mirrored: MirrorCheck | None) -> Case:
    """A scan 1 mm off (RMS) that differs in shape by 0.1 mm."""
    checks, surfaces = SimpleNamespace(mirrored=mirrored), SimpleNamespace(detail_mm=0.1)
    return cast(Case, SimpleNamespace(checks=checks, rms_mm=1.0, surfaces=surfaces))


@pytest.mark.parametrize(
    ("mirrored", "is_better"),
    [
        (None, False),  # not tested
        (MirrorCheck(0.95), False),
        (MirrorCheck(0.8, detail_mm=0.05), True),
        (MirrorCheck(0.8, detail_mm=0.2), False),  # a warp: what it leaves is another shape
        (MirrorCheck(0.3, detail_mm=0.05, same_part=0.99, pose=0.99, is_tight=True), True),
    ],
)
def test_the_mirrored_scan_has_to_leave_less_and_differ_less_in_shape(
    mirrored: MirrorCheck | None, is_better: bool
) -> None:
    assert Case.mirror_fits_better(case_of(mirrored)) is is_better
