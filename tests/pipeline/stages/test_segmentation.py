"""The segmentation is what the full matrix of distances gives, vertex by vertex; and the user may choose."""

import numpy as np
import pytest

from pipeline.core.errors import ComponentsTooSmall
from pipeline.core.mesh import Mesh
from pipeline.core.settings import GeodesicsSettings, SegmentationSettings
from pipeline.kernels import density_peaks
from pipeline.kernels.geodesics import density_rank, rounded
from pipeline.stages.geodesics import Geodesics, geodesics
from pipeline.stages.segmentation import Segmentation, segment
from tests.support import shapes

PAPER = SegmentationSettings(quantile=0.02, density="vertex", kernel="cutoff", centre_rule="decision_graph")
AREA = PAPER.model_copy(update={"density": "area"})


def segmented(
    mesh: Mesh, settings: SegmentationSettings, metric: str = "surface"
) -> tuple[Geodesics, Segmentation]:
    size_mm = float(np.sqrt(mesh.face_areas_mm2().sum()))
    distances = geodesics(
        mesh, "mesh", size_mm, GeodesicsSettings.model_validate({"metric": metric}), settings
    )
    return distances, segment(mesh, "mesh", distances, settings)


def separate_spheres() -> Mesh:
    spheres = [shapes.icosphere(size, 3) for size in (4.0, 3.0, 0.3)]
    offsets = np.cumsum([0] + [len(sphere.vertices) for sphere in spheres])
    return Mesh(
        np.concatenate([sphere.vertices + np.array([12.0 * k, 0, 0]) for k, sphere in enumerate(spheres)]),
        np.concatenate([sphere.faces + offset for sphere, offset in zip(spheres, offsets, strict=False)]),
    )


@pytest.mark.parametrize("settings", [PAPER, AREA], ids=["vertex", "area"])
@pytest.mark.parametrize("metric", ["surface", "crease"])
@pytest.mark.parametrize("mesh", [shapes.bumpy_blob(3), separate_spheres()], ids=["blob", "three spheres"])
def test_everything_is_what_the_full_matrix_gives(
    mesh: Mesh, metric: str, settings: SegmentationSettings
) -> None:
    """rho, delta, d_c, labels and halo by Rodriguez & Laio's formulas on all pairs, every vertex."""
    distances, found = segmented(mesh, settings, metric)
    n = len(mesh.vertices)
    rows = distances.solver.distances(np.arange(n))
    matrix = np.minimum(rows, rows.T)
    pairs = np.sort(matrix[np.triu_indices(n, 1)])
    d_c = pairs[max(1, round(settings.quantile * len(pairs))) - 1]
    assert found.d_c_mm == d_c

    rho = rounded((matrix < d_c) @ distances.weights)
    np.testing.assert_array_equal(found.rho, rho)
    rank = density_rank(rho)
    denser = np.where(rank[None] < rank[:, None], matrix, np.inf)
    top = np.isinf(denser.min(axis=1))
    delta = np.where(top, np.where(np.isfinite(rows), rows, 0).max(axis=1), denser.min(axis=1))
    np.testing.assert_array_equal(found.delta, delta)

    labels = np.full(n, -1)
    labels[found.centres] = np.arange(len(found.centres))
    for i in np.argsort(rank):  # downhill, each after its nearest denser vertex
        if labels[i] < 0 and not top[i]:
            labels[i] = labels[denser[i].argmin()]
    has_centre = labels >= 0
    np.testing.assert_array_equal(found.labels[has_centre], labels[has_centre])
    other = (labels[None] != labels[:, None]) & has_centre[None] & has_centre[:, None]
    touches = ((matrix < d_c) & other).any(axis=1)
    border = np.array([rho[touches & (labels == c)].max(initial=0) for c in range(len(found.centres))])
    np.testing.assert_array_equal(found.halo[has_centre], (rho < border[labels])[has_centre])


def test_each_large_piece_has_a_centre_and_a_crumb_has_none() -> None:
    _, found = segmented(separate_spheres(), PAPER)
    pieces = np.repeat([0, 1, 2], len(shapes.icosphere(1.0, 3).vertices))
    assert set(pieces[found.centres]) == {0, 1}
    assert found.halo[pieces == 2].all() and (found.labels >= 0).all()


def test_no_piece_large_enough_is_a_clear_error() -> None:
    with pytest.raises(ComponentsTooSmall, match=r"lower segmentation\.min_component_share"):
        segmented(separate_spheres(), PAPER.model_copy(update={"min_component_share": 0.9}))


def test_the_user_may_choose_in_the_decision_graph() -> None:
    blob = shapes.bumpy_blob(3)
    _, found = segmented(blob, AREA)
    gamma = np.sort(found.rho * found.delta)[::-1]
    for n in (1, 3, 5):
        _, chosen = segmented(blob, AREA.model_copy(update={"n_centres": n}))
        assert len(chosen.centres) == n
        np.testing.assert_allclose((chosen.rho * chosen.delta)[chosen.centres], gamma[:n])
    limits = {"rho_min": float(np.median(found.rho)), "delta_min_mm": 6.0}
    _, chosen = segmented(blob, AREA.model_copy(update=limits))
    above = (found.rho >= limits["rho_min"]) & (found.delta >= 6.0)
    assert set(chosen.centres) == set(np.flatnonzero(above))


def test_default_finds_the_bumps_of_a_bumpy_plate() -> None:
    """3 x 2 bumps on a plate: one segment each, however many vertices the triangulation spends on them."""
    plate = shapes.grid_plane(61, 41)
    x, y = plate.vertices[:, 0], plate.vertices[:, 1]
    tops = [(12 + 18 * i, 11 + 18 * j) for i in range(3) for j in range(2)]
    z = sum(5.0 * np.exp(-(((x - u) ** 2 + (y - v) ** 2) / 5.0**2)) for u, v in tops)
    mesh = Mesh(np.column_stack([x, y, z]), plate.faces)
    _, found = segmented(mesh, SegmentationSettings(), "crease")
    nearest_top = [int(np.argmin([np.hypot(x[c] - u, y[c] - v) for u, v in tops])) for c in found.centres]
    assert sorted(nearest_top) == list(range(6))
    at_top = np.array([np.argmin((x - u) ** 2 + (y - v) ** 2) for u, v in tops])
    assert len(set(found.labels[at_top])) == 6


def test_equal_centres_order_by_rho_times_delta() -> None:
    _, found = segmented(shapes.bumpy_blob(3), AREA)
    gamma = (found.rho * found.delta)[found.centres]
    assert (np.diff(gamma) <= 0).all()
    assert set(found.labels) == set(range(len(found.centres)))
    np.testing.assert_array_equal(found.labels[found.centres], np.arange(len(found.centres)))
    assert density_peaks.assign(np.array([-1, 0]), np.array([0])).tolist() == [0, 0]
