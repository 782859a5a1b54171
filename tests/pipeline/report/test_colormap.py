"""Colours of the deviation: zero is neutral, signs are told apart, equal sizes look equally strong."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pipeline.report.colormap import BLUE, NOT_COUNTED, RED, ColourScale, resolution_mm, round_up, table


def lightness(rgb: np.ndarray) -> np.ndarray:
    linear = np.where(rgb > 0.04045, ((rgb + 0.055) / 1.055) ** 2.4, rgb / 12.92)
    y = linear @ [0.2126729, 0.7151522, 0.0721750]
    return 116 * np.cbrt(y) - 16


def test_the_map_is_morelands() -> None:
    """Its ends are given, its middle is grey (221, 221, 221), and lightness rises to the middle and falls
    after it.
    """
    found = table()
    assert np.allclose(found[0] * 255, BLUE, atol=0.6) and np.allclose(found[-1] * 255, RED, atol=0.6)
    assert np.allclose(found[128] * 255, 221, atol=1.0)
    steps = np.diff(lightness(found))
    assert (steps[:126] > -0.05).all() and (steps[130:] < 0.05).all()


@given(st.floats(1e-6, 1e6))
def test_limits_are_round_and_no_smaller(value: float) -> None:
    found = round_up(value)
    assert value * (1 - 1e-6) <= found <= 2 * value + 1e-6
    digits = found / 10 ** np.floor(np.log10(found) + 1e-9)
    assert min(abs(digits - each) for each in (1, 1.5, 2, 3, 5, 7.5, 10)) < 1e-6


def test_within_the_tolerance_all_is_neutral_and_beyond_it_the_sign_shows() -> None:
    scale = ColourScale(1.0, 0.2)
    signed = np.array([-5.0, -1.0, -0.6, -0.2, 0.0, 0.2, 0.6, 1.0, 5.0])
    colours = scale.colours(signed)
    assert (colours[3:6] == table()[128]).all()
    assert (colours[0] == colours[1]).all() and (colours[-1] == colours[-2]).all()
    assert colours[2][2] > colours[2][0] and colours[6][0] > colours[6][2]  # blue is too little, red too much
    uncounted = scale.colours(signed, np.zeros(9, dtype=bool))
    assert (uncounted == NOT_COUNTED).all()


@pytest.mark.parametrize("tolerance_mm", [None, 0.05, 0.5])
def test_the_scale_takes_in_what_is_needed_and_twice_the_tolerance(tolerance_mm: float | None) -> None:
    scale = ColourScale.of(0.26, 0.01, tolerance_mm)
    assert scale.limit_mm == (1.0 if tolerance_mm == 0.5 else 0.3)
    assert ColourScale.of(0.0, 0.0, None).limit_mm > 0


def test_what_no_scan_shows_has_no_colour() -> None:
    """Rounding of a file in single precision on a part of 100 mm, without a tolerance."""
    rounding = np.array([-3e-5, 3e-5])
    for accuracy_mm, noise_mm, least_mm in ((None, None, 0.01), (0.02, 0.5, 0.04), (None, 0.01, 0.02)):
        scale = ColourScale.of(3e-5, resolution_mm(accuracy_mm, noise_mm, 100.0), None)
        assert scale.limit_mm >= least_mm
        assert np.allclose(scale.colours(rounding), table()[128], atol=0.01)
