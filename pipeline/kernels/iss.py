"""Intrinsic shape signatures: keypoints whose neighbourhood varies in all three directions.

Zhong, "Intrinsic shape signatures: a shape descriptor for 3D object recognition" (2009). open3d selects the
keypoints (versions before its pull request 6079 of 2023 had a race between threads). It does not return their
saliency, which is the smallest eigenvalue of the covariance of the neighbourhood, so the saliency is computed
here from the same neighbours. Like open3d, this module omits Zhong's weights for uneven sampling: the working
mesh is sampled evenly.
"""

from dataclasses import dataclass

import numpy as np
import open3d as o3d
from scipy.spatial import cKDTree

from pipeline.core.mesh import BoolArray, FloatArray

#: Radii of the neighbourhood and of the non-maximum suppression, in resolutions of the model (mean distance
#: to the nearest other point); the defaults of open3d and PCL.
SALIENT_RESOLUTIONS = 6.0
NON_MAX_RESOLUTIONS = 4.0
#: Largest ratio of an eigenvalue to the next larger one, no unit; the default of open3d and PCL.
GAMMA = 0.975
#: Fewest neighbours of a keypoint; the default of open3d and PCL.
MIN_NEIGHBOURS = 5
#: Smallest saliency of a keypoint, in squared radii; below it there is only rounding error, as on a plane.
#: Chosen by hand, not fitted.
_FLAT = 1e-10


@dataclass(frozen=True, slots=True)
class Salient:
    """saliency : (n,) mm^2; keypoint : (n,) whether the vertex is a keypoint"""

    saliency: FloatArray
    keypoint: BoolArray


def keypoints(points: FloatArray) -> Salient:
    """Keypoints and saliency of `points` (n, 3) mm."""
    resolution = _resolution_mm(points)
    if resolution == 0:
        return Salient(np.zeros(len(points)), np.zeros(len(points), dtype=np.bool_))
    centred = points - points.mean(axis=0)  # open3d computes moments about the origin
    radius = SALIENT_RESOLUTIONS * resolution
    cloud = o3d.geometry.PointCloud(o3d.utility.Vector3dVector(centred))
    selected = o3d.geometry.keypoint.compute_iss_keypoints(
        cloud, radius, NON_MAX_RESOLUTIONS * resolution, GAMMA, GAMMA, MIN_NEIGHBOURS
    )
    is_keypoint = np.zeros(len(points), dtype=np.bool_)
    positions = np.asarray(selected.points, dtype=np.float64).reshape(-1, 3)
    is_keypoint[cKDTree(centred).query(positions)[1] if len(positions) else []] = True
    saliency = saliency_mm2(centred, radius)
    return Salient(saliency, is_keypoint & (saliency > _FLAT * radius**2))


def saliency_mm2(points: FloatArray, radius_mm: float) -> FloatArray:
    """(n,) mm^2: smallest eigenvalue of the covariance of the points within `radius_mm` (Zhong 2009).

    points : (n, 3) mm. The value is 0 with fewer than `MIN_NEIGHBOURS` points.
    """
    tree = cKDTree(points)
    near = tree.sparse_distance_matrix(tree, radius_mm, output_type="coo_matrix")
    i, j = near.row, near.col
    offset = points[j] - points[i]  # moments about the origin would lose digits
    count = np.bincount(i, minlength=len(points)).astype(np.float64)
    count_or_1 = np.maximum(count, 1.0)
    mean = np.stack(
        [np.bincount(i, offset[:, a], minlength=len(points)) / count_or_1 for a in range(3)], axis=1
    )
    covariance = np.zeros((len(points), 3, 3))
    for a, b in ((0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2)):
        second = np.bincount(i, offset[:, a] * offset[:, b], minlength=len(points)) / count_or_1
        covariance[:, a, b] = covariance[:, b, a] = second - mean[:, a] * mean[:, b]
    smallest = np.maximum(np.linalg.eigvalsh(covariance)[:, 0], 0.0)
    return np.asarray(np.where(count >= MIN_NEIGHBOURS, smallest, 0.0), dtype=np.float64)


def _resolution_mm(points: FloatArray) -> float:
    """Mean distance to the nearest other point, mm."""
    if len(points) < 2:
        return 0.0
    return float(np.mean(cKDTree(points).query(points, k=[2])[0]))
