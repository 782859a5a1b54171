"""Deviations over patches, against plates with known bumps."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pipeline.inspection.extremes import extremes
from pipeline.inspection.patches import MEDIAN_ERROR, median_of, patches
from pipeline.kernels.surface_patches import adjacency_of
from tests.pipeline.inspection.surfaces import bump, measured, plate


def test_a_patch_within_a_bump_has_its_height_and_one_beside_it_none() -> None:
    surface = measured(lambda p: bump(p, (20, 12), 4.0, 0.3))
    found = patches(surface, 3.0)
    away = np.linalg.norm(surface.place_mm[:, :2] - [20, 12], axis=1)
    assert found.value_mm[away <= 2.4] == pytest.approx(0.3)
    assert found.value_mm[away >= 5.6] == pytest.approx(0.0)
    inner = (np.abs(surface.place_mm[:, :2] - 19.5) < 17).all(axis=1)
    assert found.n[inner] == pytest.approx(np.pi * 1.5**2 / 0.25**2, rel=0.05)


def test_single_wrong_vertices_change_nothing() -> None:
    def with_spikes(points: np.ndarray) -> np.ndarray:
        deviation = np.full(len(points), 0.01)
        deviation[::97] = 5.0
        return deviation

    assert patches(measured(with_spikes), 3.0).value_mm == pytest.approx(0.01)


def test_the_other_side_of_a_thin_wall_does_not_count() -> None:
    surface = measured(lambda p: np.full(len(p), 0.2))
    surface.normal[::2] = [0.0, 0.0, -1.0]
    surface.signed_mm[::2] = -9.0
    assert patches(surface, 3.0).value_mm == pytest.approx(0.2)


def test_where_no_vertex_lies_the_design_is_measured_to_the_scan() -> None:
    surface = measured(lambda p: np.zeros(len(p)))
    broken = surface.foot_mm[:, 0] < 10
    surface.normal[broken] = [0.0, 0.0, -1.0]  # nothing of that side there
    surface.signed_at_place_mm[:] = np.where(surface.place_mm[:, 0] < 10, -2.0, 0.0)
    found = patches(surface, 3.0)
    assert found.value_mm[surface.place_mm[:, 0] < 8] == pytest.approx(-2.0)
    assert found.value_mm[surface.place_mm[:, 0] > 12] == pytest.approx(0.0)


def test_where_the_scan_shows_nothing_there_is_no_value() -> None:
    surface = measured(lambda p: np.zeros(len(p)))
    surface.normal[surface.foot_mm[:, 0] < 10] = [0.0, 0.0, -1.0]
    assert np.isnan(patches(surface, 3.0).value_mm[surface.place_mm[:, 0] < 8]).all()


def test_extremes_are_the_bumps_and_dents_with_their_area() -> None:
    design = plate()
    surface = measured(
        lambda p: bump(p, (9, 9), 3.0, 0.5) + bump(p, (28, 10), 4.0, 0.2) - bump(p, (20, 30), 5.0, 0.4),
        design,
    )
    found = extremes(surface, patches(surface, 2.0), adjacency_of(design))
    assert [each.value_mm for each in found] == pytest.approx([0.5, -0.4, 0.2])
    for each, centre, radius in zip(found, [(9, 9), (20, 30), (28, 10)], [3.0, 5.0, 4.0], strict=True):
        assert np.hypot(each.position_mm[0] - centre[0], each.position_mm[1] - centre[1]) <= radius
        assert each.area_mm2 == pytest.approx(np.pi * radius**2, rel=0.15)


@given(shift=st.floats(-5, 5), scale=st.floats(0.01, 100))
@settings(max_examples=8, deadline=None)
def test_values_move_and_scale_with_the_deviations(shift: float, scale: float) -> None:
    noise = np.random.default_rng(0).normal(size=160 * 160)
    surface, changed = (
        measured(lambda p, f=f: f(noise[: len(p)])) for f in (lambda x: x, lambda x: scale * x + shift)
    )
    before, after = patches(surface, 2.0), patches(changed, 2.0)
    assert after.value_mm == pytest.approx(scale * before.value_mm + shift, abs=1e-9)
    assert after.error_mm == pytest.approx(scale * before.error_mm, rel=1e-6)


@pytest.mark.parametrize("n", [25, 101, 400])
def test_the_standard_error_covers_the_true_value_as_often_as_it_should(n: int) -> None:
    rng = np.random.default_rng(n)
    values = [median_of(rng.normal(0.3, 0.05, n)) for _ in range(1000)]
    hits = np.mean([abs(each.median_mm - 0.3) <= 1.96 * (each.error_mm or 0) for each in values])
    assert 0.90 <= hits <= 0.99
    spread = np.std([each.median_mm for each in values])
    assert spread == pytest.approx(MEDIAN_ERROR * 0.05 / np.sqrt(n), rel=0.1)
