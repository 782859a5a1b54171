"""A part that is longer than its design, or larger, is no warped print; and the reverse."""

import numpy as np
import pytest

from pipeline.core.mesh import FloatArray, Mesh
from pipeline.kernels.strain import Strain
from pipeline.kernels.surface import Surface
from pipeline.stages.registration import evaluate_fit
from pipeline.verification.size_evidence import assess_size, is_other_size, is_stretched
from tests.support import shapes

BLOB = shapes.bumpy_blob(4)
INLIER_MM = 1.3
NOISE_MM = 0.03  # 0.05 % of the diagonal


def strain_of(vertices: FloatArray) -> Strain | None:
    """Of a scan in place, with noise."""
    noise = np.random.default_rng(0).normal(0.0, NOISE_MM, len(vertices))
    scan = Mesh(vertices + noise[:, None] * BLOB.vertex_normals(), BLOB.faces)
    surface = Surface(BLOB)
    fit = evaluate_fit(scan, scan.weights(), surface, np.eye(4), INLIER_MM)
    return assess_size(scan, fit, surface, INLIER_MM, 0)


def scaled(x: float, y: float, z: float) -> FloatArray:
    return np.asarray(BLOB.vertices * [x, y, z])


@pytest.mark.parametrize(
    ("factors", "stretched", "other_size"),
    [
        ((1.0, 1.0, 1.0), False, False),
        ((0.98, 0.98, 0.98), False, False),  # as castings shrink
        ((0.995, 0.995, 0.99), False, False),  # as prints shrink
        ((1.04, 1.0, 1.0), True, False),
        ((1.0, 1.0, 0.96), True, False),
        ((1.03, 1.03, 1.03), False, True),
        ((0.97, 0.97, 0.97), False, True),
    ],
)
def test_sizes(factors: tuple[float, float, float], stretched: bool, other_size: bool) -> None:
    strain = strain_of(scaled(*factors))
    assert strain is not None
    assert is_stretched(strain, 0.0) is stretched
    assert is_other_size(strain, 0.0) is other_size


def test_a_warped_print_is_no_other_size() -> None:
    size_mm = BLOB.diagonal_mm
    for seed in range(4):
        rng = np.random.default_rng(seed)
        wave = rng.normal(size=(3, 3)) * 1.4 * np.pi / size_mm
        warp = np.sin(BLOB.vertices @ wave.T) * 0.003 * size_mm / np.sqrt(3)
        strain = strain_of(BLOB.vertices + warp)
        assert strain is not None
        assert not is_stretched(strain, 0.0) and not is_other_size(strain, 0.0)


def test_a_scanner_that_is_as_rough_as_the_difference_shows_none() -> None:
    strain = strain_of(scaled(1.04, 1.0, 1.0))
    assert strain is not None
    assert is_stretched(strain, 0.5 * strain.shape_mm)
    assert not is_stretched(strain, 1.1 * strain.shape_mm)
