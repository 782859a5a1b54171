"""Axes of a chart: ends, ticks, and what lies between them."""

import re

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pipeline.report.chart import Scale, css, padded, tick_label

LENGTHS = st.floats(1e-3, 1e4)


@given(low=st.floats(-1e4, 1e4), length=LENGTHS)
def test_ticks_of_a_linear_axis_are_few_even_and_inside(low: float, length: float) -> None:
    ticks = Scale(low, low + length, 0.0, 100.0).ticks()
    assert 2 <= len(ticks) <= 8
    assert low <= ticks[0] and ticks[-1] <= low + length
    steps = np.diff(ticks)
    np.testing.assert_allclose(steps, steps[0], rtol=1e-6)


@given(low=LENGTHS, decades=st.floats(0.4, 8.0))
def test_ticks_of_a_logarithmic_axis_are_inside_and_at_least_one(low: float, decades: float) -> None:
    high = low * 10**decades
    ticks = Scale(low, high, 0.0, 100.0, log=True).ticks()
    assert 1 <= len(ticks) <= 9
    assert low <= ticks[0] and ticks[-1] <= high and ticks == sorted(ticks)


@pytest.mark.parametrize("log", [False, True])
def test_ends_of_a_scale_and_its_middle(log: bool) -> None:
    scale = Scale(1.0, 100.0, 300.0, 20.0, log=log)
    middle = 10.0 if log else 50.5
    np.testing.assert_allclose(scale(np.array([1.0, middle, 100.0])), [300.0, 160.0, 20.0])


def test_limits_leave_room_and_one_value_has_some_too() -> None:
    assert padded(0.0, 10.0, share=0.1) == (-1.0, 11.0)
    low, high = padded(5.0, 5.0)
    assert low < 5.0 < high
    low, high = padded(5.0, 5.0, log=True)
    assert 0 < low < 5.0 < high


def test_colours_in_css() -> None:
    assert css(np.array([1.0, 0.5, -0.1])) == "#ff8000"


@pytest.mark.parametrize(
    ("value", "words"),
    [
        (0.0, "0"),
        (-0.2, "\N{MINUS SIGN}0.2"),
        (1e5, "100000"),
        (1e6, "10^6"),
        (2e-7, "2 · 10^\N{MINUS SIGN}7"),
    ],
)
def test_tick_labels(value: float, words: str) -> None:
    assert re.sub(r"<tspan[^>]*>(.*?)</tspan>", r"^\1", tick_label(value)) == words
