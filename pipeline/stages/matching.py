"""Which pose: hypotheses from landmarks (and cheap independent sources), judged by how the whole scan fits."""

from dataclasses import dataclass
from typing import Literal

import numpy as np
import open3d as o3d
from scipy.spatial import cKDTree

from pipeline.kernels import icp, poses, rigid, sampling
from pipeline.kernels.nearest_grid import NearestGrid
from pipeline.mesh import FloatArray, IndexArray, Mesh
from pipeline.settings import MatchingSettings
from pipeline.stages.landmarks import LandmarkSet

Source = Literal["landmarks", "dense", "axes"]
_SOURCES: tuple[Source, ...] = ("landmarks", "dense", "axes")

DESIGN_SAMPLES = 20_000
DENSE_POINTS = 160
COARSE_POINTS = 300
KEEP_APART_SHARE = 0.04  # of the diagonal: nearer poses are one hypothesis
COARSE_SHARE = 0.05  # of the diagonal: truncation while poses are still rough
FINE_SHARE = 0.015
FINALISTS = 12


@dataclass(frozen=True, slots=True)
class Side:
    """One mesh as matching sees it: working mesh, its landmarks."""

    mesh: Mesh
    landmarks: LandmarkSet


@dataclass(frozen=True, slots=True)
class Hypothesis:
    """T_design_scan after a short ICP; cost_mm2 : truncated point-to-plane cost; source : where it came from"""

    T_design_scan: FloatArray
    cost_mm2: float
    source: Source


@dataclass(frozen=True, slots=True)
class Matching:
    """hypotheses : distinct poses, best first (never empty); T_landmarks : fit of the matched landmarks alone under the
    best pose, None when fewer than three match; design, scan : (k,) numbers of the matched landmarks
    """

    hypotheses: tuple[Hypothesis, ...]
    T_landmarks: FloatArray | None
    design: IndexArray
    scan: IndexArray


def match(design: Side, scan: Side, radius_mm: float, settings: MatchingSettings, seed: int) -> Matching:
    """Poses of two corresponding oriented points, each refined by a short ICP; the lowest truncated
    point-to-plane cost with agreeing normals wins.
    """
    diagonal = design.mesh.diagonal_mm
    samples = sampling.on_surface(design.mesh, DESIGN_SAMPLES, seed)
    probes = sampling.on_surface(scan.mesh, settings.sample_points, seed + 1)
    target = icp.Target(cKDTree(samples.points), samples.points, samples.normals)

    T, source = _candidates(design, scan, samples.points, probes.points, radius_mm, settings)
    few = slice(None, None, max(1, len(probes.points) // COARSE_POINTS))
    grid = NearestGrid(samples.points, samples.normals, COARSE_SHARE * diagonal)
    coarse = grid.costs(T, probes.points[few], probes.normals[few], COARSE_SHARE * diagonal)
    corners = _corners(scan.mesh)
    apart = KEEP_APART_SHARE * diagonal
    first = poses.distinct(T, np.argsort(coarse, kind="stable"), corners, apart, settings.max_hypotheses)
    T, source = T[first], source[first]

    T, cost = icp.refine_many(
        probes.points[few], probes.normals[few], target, T, max_distance_mm=COARSE_SHARE * diagonal, iterations=8
    )
    best = poses.distinct(T, np.argsort(cost, kind="stable"), corners, apart, FINALISTS)
    T, source = T[best], source[best]
    T, _ = icp.refine_many(
        probes.points, probes.normals, target, T, max_distance_mm=2 * FINE_SHARE * diagonal, iterations=6
    )
    T, cost = icp.refine_many(
        probes.points, probes.normals, target, T, max_distance_mm=FINE_SHARE * diagonal, iterations=10
    )
    final = poses.distinct(T, np.argsort(cost, kind="stable"), corners, apart, FINALISTS)
    hypotheses = tuple(Hypothesis(rigid.orthonormal(T[k]), float(cost[k]), _SOURCES[source[k]]) for k in final)
    return _with_matches(design, scan, hypotheses, radius_mm)


def _candidates(
    design: Side,
    scan: Side,
    design_points: FloatArray,
    scan_points: FloatArray,
    radius_mm: float,
    settings: MatchingSettings,
) -> tuple[FloatArray, IndexArray]:
    """(h, 4, 4) poses and for each the number of its source in `_SOURCES`."""
    support = settings.descriptor_radius_radii * radius_mm
    design_fpfh, scan_fpfh = fpfh(design.mesh, support), fpfh(scan.mesh, support)
    pools: list[FloatArray] = [np.zeros((0, 4, 4))]
    numbers: list[IndexArray] = [np.zeros(0, dtype=np.int64)]

    def pool(number: int, found: FloatArray) -> None:
        pools.append(found)
        numbers.append(np.full(len(found), number))

    def from_pairs(scan_vertex: IndexArray, design_vertex: IndexArray, candidates: int) -> FloatArray:
        i, j = _nearest_descriptors(scan_fpfh[scan_vertex], design_fpfh[design_vertex], candidates)
        scan_normals, design_normals = scan.mesh.vertex_normals(), design.mesh.vertex_normals()
        i, j = scan_vertex[i], design_vertex[j]
        return poses.from_oriented_pairs(
            (scan.mesh.vertices[i], scan_normals[i]),
            (design.mesh.vertices[j], design_normals[j]),
            length_tolerance_mm=1.5 * radius_mm,
            min_length_mm=4 * radius_mm,
            max_pairs=settings.max_pairs // 10,
        )

    if len(design.landmarks.vertex) >= 2 and len(scan.landmarks.vertex) >= 2:
        pool(0, from_pairs(scan.landmarks.vertex, design.landmarks.vertex, settings.candidates))
    if settings.dense_pairs:
        spread = sampling.farthest(scan.mesh.vertices, DENSE_POINTS)
        everywhere = sampling.farthest(design.mesh.vertices, 4 * DENSE_POINTS)
        pool(1, from_pairs(spread, everywhere, 3))
    if settings.axes_poses or sum(map(len, pools)) == 0:
        pool(2, poses.from_axes(scan_points, design_points))
    return np.concatenate(pools), np.concatenate(numbers)


def fpfh(mesh: Mesh, radius_mm: float) -> FloatArray:
    """(n, 33) fast point feature histograms (Rusu et al. 2009) at every vertex, over `radius_mm`."""
    cloud = o3d.geometry.PointCloud(o3d.utility.Vector3dVector(np.array(mesh.vertices)))
    cloud.normals = o3d.utility.Vector3dVector(mesh.vertex_normals())
    feature = o3d.pipelines.registration.compute_fpfh_feature(
        cloud, o3d.geometry.KDTreeSearchParamRadius(radius_mm)
    )
    return np.ascontiguousarray(np.asarray(feature.data, dtype=np.float64).T)


def _nearest_descriptors(
    scan_fpfh: FloatArray, design_fpfh: FloatArray, candidates: int
) -> tuple[IndexArray, IndexArray]:
    k = min(candidates, len(design_fpfh))
    _, found = cKDTree(design_fpfh).query(scan_fpfh, k=list(range(1, k + 1)))
    return np.repeat(np.arange(len(scan_fpfh)), k), found.ravel().astype(np.int64)


def _with_matches(
    design: Side, scan: Side, hypotheses: tuple[Hypothesis, ...], radius_mm: float
) -> Matching:
    """Landmarks that are each other's nearest under the best pose, within a feature radius."""
    nobody = np.zeros(0, dtype=np.int64)
    q, p = design.landmarks.position_mm, rigid.transformed(hypotheses[0].T_design_scan, scan.landmarks.position_mm)
    if len(q) == 0 or len(p) == 0:
        return Matching(hypotheses, None, nobody, nobody)
    distance, to_design = cKDTree(q).query(p)
    _, to_scan = cKDTree(p).query(q)
    mutual = (to_scan[to_design] == np.arange(len(p))) & (distance <= radius_mm)
    i = np.flatnonzero(mutual)
    j = to_design[i].astype(np.int64)
    T = rigid.fit(scan.landmarks.position_mm[i], q[j]) if _spans_a_plane(q[j], radius_mm) else None
    return Matching(hypotheses, T, j, i)


def _spans_a_plane(points: FloatArray, radius_mm: float) -> bool:
    """Whether the points fix a rotation: three or more, and not within a feature radius of one line."""
    if len(points) < 3:
        return False
    spread = np.linalg.svd(points - points.mean(axis=0), compute_uv=False) / np.sqrt(len(points))
    return bool(spread[1] > radius_mm)


def _corners(mesh: Mesh) -> FloatArray:
    low, high = mesh.vertices.min(axis=0), mesh.vertices.max(axis=0)
    grid = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)], dtype=np.float64)
    return low + grid * (high - low)
