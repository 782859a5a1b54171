"""What others offer for the same job, on the same meshes: each a function (design, scan, seed) ->
T_design_scan or None.

Every peer does its own global search; what it finds is then refined to the end by one and the same
point-to-plane ICP (open3d), so that the table compares searches. None of them says whether its pose can be
trusted: what it returns is its answer.

- Open3D RANSAC and FGR: voxel 2 % of the design's diagonal (1 and 1.5 % found fewer depth-camera pairs), FPFH
  within 5
  voxels, matches within 1.5 and 0.5 voxels, as in Open3D's tutorial on global registration.
- KISS-Matcher: Lim et al. 2025, package `kiss-matcher`, voxel 1 %, noise-bound clamping off, and the design's
  diagonal
  scaled to 100 (it is meant for metres, and refuses small voxels).
- trimesh `mesh_other`: principal axes of inertia with flips, ICP of 500 samples, no scale, no reflection.
- PCA + flips: principal axes of the samples, the four proper sign flips, each with the ICP, the lowest cost
  wins.

The scan's normals come from its triangles, for a cloud from neighbours, turned away from the centroid.
"""

from collections.abc import Callable
from dataclasses import dataclass
from importlib.util import find_spec
from typing import Any

import numpy as np
import trimesh

from pipeline.core.mesh import FloatArray, Mesh
from pipeline.kernels import rigid, sampling

SAMPLES = 40_000
VOXEL_SHARE, KISS_VOXEL_SHARE = 0.02, 0.01  # of the diagonal
ICP_VOXEL_SHARE = 0.005
ICP_SHARES = (0.03, 0.01)  # allowed distance of a match, in two rounds
ICP_ITERATIONS = 100
ICP_TOLERANCE = 1e-7  # relative change of fitness and RMSE
FLIP_ITERATIONS = 30
KISS_SIZE = 100.0
RANSAC_ITERATIONS, RANSAC_CONFIDENCE = 100_000, 0.999

Peer = Callable[[Mesh, Mesh, int], FloatArray | None]


@dataclass(frozen=True, slots=True)
class _Pair:
    """design, scan : open3d clouds with normals; size_mm : the design's diagonal"""

    design: Any
    scan: Any
    size_mm: float

    @property
    def voxel_mm(self) -> float:
        return VOXEL_SHARE * self.size_mm

    @property
    def icp_voxel_mm(self) -> float:
        return ICP_VOXEL_SHARE * self.size_mm


def ransac(design: Mesh, scan: Mesh, seed: int) -> FloatArray | None:
    import open3d as o3d

    o3d.utility.random.seed(seed)
    pair, reg = _pair(design, scan, seed), o3d.pipelines.registration
    (target, target_features), (source, source_features) = (
        _described(pair.design, pair),
        _described(pair.scan, pair),
    )
    reach = 1.5 * pair.voxel_mm
    found = reg.registration_ransac_based_on_feature_matching(
        *(source, target, source_features, target_features, True, reach),
        reg.TransformationEstimationPointToPoint(False),
        3,
        [reg.CorrespondenceCheckerBasedOnEdgeLength(0.9), reg.CorrespondenceCheckerBasedOnDistance(reach)],
        reg.RANSACConvergenceCriteria(RANSAC_ITERATIONS, RANSAC_CONFIDENCE),
    )
    return _refined(found.transformation, pair) if len(found.correspondence_set) else None


def fgr(design: Mesh, scan: Mesh, seed: int) -> FloatArray | None:
    import open3d as o3d

    o3d.utility.random.seed(seed)
    pair, reg = _pair(design, scan, seed), o3d.pipelines.registration
    (target, target_features), (source, source_features) = (
        _described(pair.design, pair),
        _described(pair.scan, pair),
    )
    option = reg.FastGlobalRegistrationOption(maximum_correspondence_distance=0.5 * pair.voxel_mm)
    found = reg.registration_fgr_based_on_feature_matching(
        source, target, source_features, target_features, option
    )
    return _refined(found.transformation, pair)


def kiss_matcher(design: Mesh, scan: Mesh, seed: int) -> FloatArray | None:
    import kiss_matcher as kiss

    pair = _pair(design, scan, seed)
    scale = KISS_SIZE / pair.size_mm
    config = kiss.KISSMatcherConfig(
        voxel_size=KISS_VOXEL_SHARE * KISS_SIZE, enable_noise_bound_clamping=False
    )
    clouds = [(scale * np.asarray(side.points)).astype(np.float32) for side in (pair.scan, pair.design)]
    found = kiss.KISSMatcher(config).estimate(*clouds)
    if not found.valid:
        return None
    return _refined(
        rigid.compose(np.asarray(found.rotation), np.asarray(found.translation).ravel() / scale), pair
    )


def trimesh_mesh_other(design: Mesh, scan: Mesh, seed: int) -> FloatArray | None:
    part = trimesh.Trimesh(design.vertices, design.faces, process=False)
    if scan.is_cloud:
        T = np.linalg.inv(
            trimesh.registration.mesh_other(part, scan.vertices, reflection=False, seed=seed)[0]
        )
    else:
        print_ = trimesh.Trimesh(scan.vertices, scan.faces, process=False)
        T = trimesh.registration.mesh_other(print_, part, reflection=False, seed=seed)[0]
    return _refined(T, _pair(design, scan, seed))


def pca_flips(design: Mesh, scan: Mesh, seed: int) -> FloatArray | None:
    pair = _pair(design, scan, seed)
    (target, target_mean), (source, source_mean) = (
        _axes(np.asarray(side.points)) for side in (pair.design, pair.scan)
    )
    few, tried = pair.scan.voxel_down_sample(2 * pair.icp_voxel_mm), []
    for signs in ((1, 1, 1), (1, -1, -1), (-1, 1, -1), (-1, -1, 1)):
        R = target.T @ np.diag(signs) @ source
        T = rigid.compose(R, target_mean - R @ source_mean)
        tried.append(_icp(few, pair.design, T, ICP_SHARES[0] * pair.size_mm, FLIP_ITERATIONS))
    return _refined(min(tried, key=lambda T: _cost(few, T, pair)), pair)


PEERS: dict[str, Peer] = {
    "Open3D RANSAC": ransac,
    "Open3D FGR": fgr,
    "KISS-Matcher": kiss_matcher,
    "trimesh mesh_other": trimesh_mesh_other,
    "PCA + flips": pca_flips,
}
NEEDS = {"KISS-Matcher": "kiss_matcher", "trimesh mesh_other": "rtree"}


def installed() -> tuple[dict[str, Peer], list[str]]:
    """The peers that are here, and a line for each that is not."""
    missing = [name for name, module in NEEDS.items() if find_spec(module) is None]
    lines = [
        f"{name}: left out, {NEEDS[name]} is not installed (pip install -e '.[peers]')" for name in missing
    ]
    return {name: peer for name, peer in PEERS.items() if name not in missing}, lines


def _pair(design: Mesh, scan: Mesh, seed: int) -> _Pair:
    import open3d as o3d

    o3d.utility.set_verbosity_level(o3d.utility.VerbosityLevel.Error)
    return _Pair(_cloud(design, seed), _cloud(scan, seed), design.diagonal_mm)


def _cloud(mesh: Mesh, seed: int) -> Any:
    import open3d as o3d

    if mesh.is_cloud:
        cloud = o3d.geometry.PointCloud(o3d.utility.Vector3dVector(np.array(mesh.vertices)))
        cloud.estimate_normals(o3d.geometry.KDTreeSearchParamKNN(knn=20))
        cloud.orient_normals_towards_camera_location(mesh.vertices.mean(axis=0))
        cloud.normals = o3d.utility.Vector3dVector(-np.asarray(cloud.normals))
        return cloud
    samples = sampling.on_surface(mesh, SAMPLES, seed)
    cloud = o3d.geometry.PointCloud(o3d.utility.Vector3dVector(samples.points))
    cloud.normals = o3d.utility.Vector3dVector(samples.normals)
    return cloud


def _described(cloud: Any, pair: _Pair) -> tuple[Any, Any]:
    """A point a voxel, and their FPFH."""
    import open3d as o3d

    down = cloud.voxel_down_sample(pair.voxel_mm)
    near = o3d.geometry.KDTreeSearchParamHybrid(radius=5 * pair.voxel_mm, max_nn=100)
    return down, o3d.pipelines.registration.compute_fpfh_feature(down, near)


def _refined(T_design_scan: FloatArray, pair: _Pair) -> FloatArray:
    """Point-to-plane ICP to the end."""
    T, scan = np.asarray(T_design_scan, dtype=np.float64), pair.scan.voxel_down_sample(pair.icp_voxel_mm)
    for share in ICP_SHARES:
        T = _icp(scan, pair.design, T, share * pair.size_mm, ICP_ITERATIONS)
    return T


def _icp(scan: Any, design: Any, T: FloatArray, reach_mm: float, iterations: int) -> FloatArray:
    import open3d as o3d

    reg = o3d.pipelines.registration
    end = reg.ICPConvergenceCriteria(ICP_TOLERANCE, ICP_TOLERANCE, iterations)
    done = reg.registration_icp(scan, design, reach_mm, T, reg.TransformationEstimationPointToPlane(), end)
    return np.array(done.transformation)


def _cost(scan: Any, T: FloatArray, pair: _Pair) -> float:
    """Mean squared distance, truncated at the last allowed distance."""
    import open3d as o3d

    moved = o3d.geometry.PointCloud(scan).transform(T)
    reach = ICP_SHARES[-1] * pair.size_mm
    return float((np.minimum(np.asarray(moved.compute_point_cloud_distance(pair.design)), reach) ** 2).mean())


def _axes(points: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Principal axes as the rows of a rotation, and the mean."""
    mean = points.mean(axis=0)
    _, _, axes = np.linalg.svd(points - mean, full_matrices=False)
    axes[2] *= np.linalg.det(axes)
    return axes, mean
