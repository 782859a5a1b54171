"""The heat kernel signature against closed forms: a sphere, an open tube."""

import numpy as np
import pytest

from pipeline.core.mesh import Mesh
from pipeline.kernels import curvature, heat_kernel
from pipeline.kernels.heat_kernel import Spectrum
from tests.support import shapes


def spectrum_of(mesh: Mesh, count: int) -> Spectrum:
    return heat_kernel.spectrum(curvature.cotangent_laplacian(mesh), mesh.vertex_areas_mm2(), count)


@pytest.mark.parametrize(("levels", "rtol"), [(3, 0.085), (4, 0.022)], ids=["dense solver", "Lanczos"])
def test_on_a_sphere_it_is_the_series_of_legendre_everywhere(levels: int, rtol: float) -> None:
    """sum_l (2 l + 1) / (4 pi r^2) exp(-l (l + 1) t / r^2); half the edge, a quarter of the error."""
    radius = 5.0
    found = spectrum_of(shapes.icosphere(radius, levels), 256)  # all of l < 16
    times = radius**2 * np.array([0.05, 0.2, 1.0])
    degree = np.arange(200)[:, None]
    series = np.sum((2 * degree + 1) * np.exp(-degree * (degree + 1) * times / radius**2), axis=0)
    expected = series / (4 * np.pi * radius**2)
    np.testing.assert_allclose(
        heat_kernel.signature(found, times), np.broadcast_to(expected, (10 * 4**levels + 2, 3)), rtol=rtol
    )


def test_on_an_open_tube_it_is_that_of_a_circle_times_that_of_a_segment() -> None:
    """With an insulated border: 1 / (2 pi r) sum_k exp(-(k / r)^2 t) times 1 / h (1 + 2 sum_k cos^2 exp)."""
    radius, height, time = 2.0, 8.0, 1.0
    tube = shapes.cylinder(radius, height, 48, 33)
    k = np.arange(1, 60)[:, None]
    circle = (1 + 2 * np.sum(np.exp(-((k / radius) ** 2) * time))) / (2 * np.pi * radius)
    waves = np.cos(k * np.pi * tube.vertices[:, 2] / height) ** 2 * np.exp(
        -((k * np.pi / height) ** 2) * time
    )
    segment = (1 + 2 * waves.sum(axis=0)) / height
    found = heat_kernel.signature(spectrum_of(tube, 150), np.array([time]))[:, 0]
    np.testing.assert_allclose(found, circle * segment, rtol=0.02)


def test_eigenfunctions_are_orthonormal_by_area() -> None:
    blob = shapes.bumpy_blob(3)
    found = spectrum_of(blob, 40)
    areas = blob.vertex_areas_mm2()
    np.testing.assert_allclose(found.functions.T @ (areas[:, None] * found.functions), np.eye(40), atol=1e-9)
    assert found.eigenvalues[0] == pytest.approx(0, abs=1e-9 * found.eigenvalues[-1])
    assert (np.diff(found.eigenvalues) >= 0).all()


def test_two_solvers_agree() -> None:
    blob = shapes.bumpy_blob(3)
    lanczos, dense = spectrum_of(blob, 30), spectrum_of(blob, 300)
    lowest = Spectrum(dense.eigenvalues[:30], dense.functions[:, :30])
    np.testing.assert_allclose(lanczos.eigenvalues, lowest.eigenvalues, rtol=1e-9, atol=1e-12)
    times = np.array([20.0, 200.0])
    np.testing.assert_allclose(
        heat_kernel.signature(lanczos, times), heat_kernel.signature(lowest, times), rtol=1e-9
    )


def test_pieces_are_surfaces_of_their_own() -> None:
    blob = shapes.bumpy_blob(3)
    n = len(blob.vertices)
    alone = heat_kernel.signatures(blob, np.zeros(n, dtype=np.int32))
    crumb = shapes.icosphere(0.1, 1)
    vertices = [blob.vertices, blob.vertices + 100.0, crumb.vertices + 50.0, [[0.0, 0, 0]]]
    faces = [blob.faces, blob.faces + n, crumb.faces + 2 * n]
    both = Mesh(np.concatenate(vertices), np.concatenate(faces))
    pieces = np.repeat(np.arange(4, dtype=np.int32), [n, n, len(crumb.vertices), 1])
    found = heat_kernel.signatures(both, pieces)
    np.testing.assert_allclose(found[:n], found[n : 2 * n], rtol=1e-9)
    np.testing.assert_allclose(
        found[:n, 0], alone[:, 0], rtol=1e-9
    )  # the longest time; the shortest needs all 300 pairs
    assert np.isneginf(found[2 * n :]).all()
