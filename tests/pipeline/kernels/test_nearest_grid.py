"""Costs of poses by the grid of nearest samples, against the same by direct search."""

import numpy as np
from scipy.spatial import cKDTree
from scipy.spatial.transform import Rotation

from pipeline.kernels import rigid, sampling
from pipeline.kernels.nearest_grid import CELLS, NearestGrid
from tests.support import shapes

MAX_MM = 3.0


def test_costs_are_those_of_the_sample_nearest_to_the_middle_of_the_cell() -> None:
    blob = shapes.bumpy_blob(3)
    samples, scan = sampling.on_surface(blob, 2000, 0), sampling.on_surface(blob, 100, 1)
    rng = np.random.default_rng(0)
    R = Rotation.from_rotvec(0.3 * rng.standard_normal((20, 3))).as_matrix()
    T = np.array(
        [rigid.rotation_about(each, shift) for each, shift in zip(R, rng.normal(0, 9, (20, 3)), strict=True)]
    )
    T[0] = np.eye(4)
    sign = np.where(np.arange(20) % 3 == 2, -1.0, 1.0)
    costs = NearestGrid(samples.points, samples.normals, MAX_MM).costs(T, sign, scan.points, scan.normals)

    low = samples.points.min(axis=0) - MAX_MM
    extent = np.ptp(samples.points, axis=0) + 2 * MAX_MM
    cell_mm = extent.max() / CELLS
    tree = cKDTree(samples.points)
    for pose, (T_one, s) in enumerate(zip(T, sign, strict=True)):
        moved = rigid.transformed(T_one, scan.points)
        centre = low + (np.floor((moved - low) / cell_mm) + 0.5) * cell_mm
        nearest = tree.query(centre)[1]
        squared = ((moved - samples.points[nearest]) ** 2).sum(axis=1)
        agree = (s * scan.normals @ T_one[:3, :3].T * samples.normals[nearest]).sum(axis=1) > 0.5
        outside = ((moved < low) | (moved >= low + np.ceil(extent / cell_mm) * cell_mm)).any(axis=1)
        expected = np.where(agree & ~outside, np.minimum(squared, MAX_MM**2), MAX_MM**2).mean()
        np.testing.assert_allclose(costs[pose], expected, rtol=1e-12)
    assert costs[0] < 0.1 * costs.max()
