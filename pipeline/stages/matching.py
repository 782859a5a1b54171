"""Which pose: hypotheses from landmarks (and cheap independent sources), judged by how the whole scan fits."""

from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
import open3d as o3d
from scipy.spatial import cKDTree

from pipeline.core.mesh import FloatArray, IndexArray, Mesh
from pipeline.core.settings import MatchingSettings
from pipeline.kernels import icp, poses, rigid, sampling, topology
from pipeline.kernels.nearest import k_nearest, nearest
from pipeline.kernels.nearest_grid import NearestGrid
from pipeline.stages.landmarks import LandmarkSet

Source = Literal["landmarks", "dense", "axes"]
_SOURCES: tuple[Source, ...] = ("landmarks", "dense", "axes")

DESIGN_SAMPLES = 20_000
DENSE_POINTS = 160
COARSE_POINTS = 150
MAX_RANKED = 3000  # of the cheaply judged poses, so many are looked at for distinct ones
KEEP_APART_SHARE = 0.04  # of the diagonal: nearer poses are one hypothesis, other than about the best
NUDGES = (0.015, 0.03, 0.06)  # of the diagonal: from so far an ICP ends in the next tooth or hole
NEXT_SHARE = 0.01  # of the diagonal: the next tooth is at least so far off
STEPS, STEPS_ON = 4, 40  # so many of the steps to a next tooth are walked on, so often to either side
COARSE_SHARE = 0.05  # of the diagonal: truncation while poses are still rough
FINE_SHARE = 0.015
FINALISTS = 12
MOST_LANDMARKS = 400  # of a mesh, the strongest: all pairs of their candidates are looked at in one array


@dataclass(frozen=True, slots=True)
class Side:
    """One mesh as matching sees it: working mesh, its landmarks; descriptors : (n, 33) of `fpfh`, None: not computed yet"""

    mesh: Mesh
    landmarks: LandmarkSet
    descriptors: FloatArray | None = None

    def described(self, length_mm: float, settings: MatchingSettings) -> FloatArray:
        """(n, 33) FPFH of the vertices of the working mesh."""
        support_mm = settings.descriptor_radius_lengths * length_mm
        return fpfh(self.mesh, support_mm) if self.descriptors is None else self.descriptors

    def reflected(self, length_mm: float, settings: MatchingSettings) -> "Side":
        """Its mirror image in the plane x = 0, normals still out. Of a pair's three angles under reflection, alpha changes
        sign: its 11 bins are read backwards.
        """
        across = np.array([-1.0, 1.0, 1.0])
        described = self.described(length_mm, settings)
        mirrored = np.concatenate(
            [described[:, :11], described[:, 11:22][:, ::-1], described[:, 22:]], axis=1
        )
        found = self.landmarks
        landmarks = replace(found, position_mm=found.position_mm * across, normal=found.normal * across)
        return Side(Mesh(self.mesh.vertices * across, self.mesh.faces[:, ::-1]), landmarks, mirrored)


@dataclass(frozen=True, slots=True)
class Hypothesis:
    """T_design_scan after a short ICP; facing : -1 when the scan's normals point inwards under it;
    cost_mm2 : truncated point-to-plane cost; source : where it came from
    """

    T_design_scan: FloatArray
    facing: float
    cost_mm2: float
    source: Source


@dataclass(frozen=True, slots=True)
class Matching:
    """hypotheses : distinct poses, best first (never empty); design, scan : (k,) numbers of the landmarks that match under
    the best of them, or under the pose that was asked for; T_landmarks : their fit, None when fewer than three match
    """

    hypotheses: tuple[Hypothesis, ...]
    T_landmarks: FloatArray | None
    design: IndexArray
    scan: IndexArray


def match(
    design: Side,
    scan: Side,
    length_mm: float,
    settings: MatchingSettings,
    seed: int,
    images: tuple[FloatArray, ...] = (),
    near: tuple[FloatArray, ...] = (),
) -> Matching:
    """Poses of two corresponding oriented points, each refined by a short ICP; the lowest truncated
    point-to-plane cost with agreeing normals wins.

    length_mm : the length that descriptors, tolerances and shortest pairs are multiples of; images : (4, 4) each, the
    design's own symmetries where they are known: of poses that differ by one of them one is kept, so that the images of
    one pose do not crowd out others; near : those under which it is nearly its own image (`SelfImages.near`).

    An open surface does not tell its outside from its inside (depth-camera meshes come either way), so where one of the two
    is open, poses are also tried with the normals turned over.
    """
    diagonal = design.mesh.diagonal_mm
    samples = sampling.on_surface(design.mesh, DESIGN_SAMPLES, seed)
    probes = sampling.on_surface(scan.mesh, settings.sample_points, seed + 1)
    few = slice(None, None, max(1, len(probes.points) // COARSE_POINTS))
    fewer = slice(None, None, 4 * few.step)
    target = icp.Target(cKDTree(samples.points), samples.points, samples.normals)
    box = corners(scan.mesh)

    def best_distinct(pool: Pool, cost: FloatArray, most: int) -> Pool:
        order = np.argsort(cost, kind="stable")[:MAX_RANKED]
        return pool.take(poses.distinct(pool.T, order, box, KEEP_APART_SHARE * diagonal, most, images))

    def refined(pool: Pool, points: slice, share: float, iterations: int) -> tuple[Pool, FloatArray]:
        T, cost = icp.refine_many(
            probes.points[points],
            probes.normals[points],
            target,
            pool.T,
            pool.facing,
            max_distance_mm=share * diagonal,
            iterations=iterations,
        )
        return replace(pool, T=T), cost

    def next_to_best(pool: Pool) -> Pool:
        """Where the best comes to lie a tooth or a hole further: a rack or a gear fits there almost as well."""
        T = poses.perturb(pool.T[0], probes.points[few], [share * diagonal for share in NUDGES])
        around = Pool(T, np.full(len(T), pool.facing[0]), np.full(len(T), pool.source[0]), np.zeros(len(T)))
        for points, iterations in ((few, 8), (slice(None), 10)):
            if len(around.T) == 0:
                break
            around, cost = refined(around, points, FINE_SHARE, iterations)
            around = others(replace(around, cost=cost), pool)
        return around

    def further(pool: Pool, around: Pool) -> Pool:
        """On from there by the same step, as often as it goes, and where the design repeats itself: the right tooth may be
        any.
        """
        back, steps = rigid.inverse(pool.T[0]), around.take(np.argsort(around.cost, kind="stable")[:STEPS])
        moves = [*near, *(T for step in steps.T for T in poses.iterate_motion(step @ back, STEPS_ON))]
        if not moves:
            return pool.take(np.zeros(0, dtype=np.int64))
        T = np.array(moves) @ pool.T[0]
        on = Pool(T, np.full(len(T), pool.facing[0]), np.full(len(T), pool.source[0]), np.zeros(len(T)))
        seen = pool.and_then(around)
        on = others(replace(on, cost=judged(on, slice(None))), seen)
        on = on.take(np.arange(min(len(on.T), 8 * FINALISTS)))
        for points, iterations, most in ((few, 6, 8), (slice(None), 1, 1), (slice(None), 10, 1)):
            if len(on.T) == 0:
                break
            on, cost = refined(on, points, FINE_SHARE, iterations)
            on = others(replace(on, cost=cost), seen)
            on = on.take(np.arange(min(len(on.T), most * FINALISTS)))
        return on

    def others(new: Pool, known: Pool) -> Pool:
        """Those of `new` that are none of `known`, each once, the best first."""
        both = np.concatenate([known.T, new.T])
        order = np.concatenate([np.arange(len(known.T)), len(known.T) + np.argsort(new.cost, kind="stable")])
        kept = poses.distinct(both, order, box, NEXT_SHARE * diagonal, len(order), images)
        return new.take(kept[kept >= len(known.T)] - len(known.T))

    pool = _candidates(design, scan, samples.points, probes.points, length_mm, settings)
    grid = NearestGrid(samples.points, samples.normals, COARSE_SHARE * diagonal)

    def judged(pool: Pool, points: slice) -> FloatArray:
        return grid.costs(
            pool.T, pool.facing, probes.points[points], probes.normals[points], COARSE_SHARE * diagonal
        )

    pool = pool.take(np.sort(np.argsort(judged(pool, fewer), kind="stable")[: 2 * MAX_RANKED]))
    pool = best_distinct(pool, judged(pool, few), settings.max_hypotheses)
    pool, cost = refined(pool, few, COARSE_SHARE, 8)
    pool = best_distinct(pool, cost, FINALISTS)
    pool, _ = refined(pool, slice(None), 2 * FINE_SHARE, 6)
    pool, cost = refined(pool, slice(None), FINE_SHARE, 10)
    numbered = replace(pool, cost=cost)
    pool = best_distinct(numbered, cost, FINALISTS)
    around = next_to_best(pool)
    pool = pool.and_then(around).and_then(further(pool, around))
    hypotheses = tuple(
        Hypothesis(
            rigid.orthonormal(pool.T[k]), float(pool.facing[k]), float(pool.cost[k]), _SOURCES[pool.source[k]]
        )
        for k in range(len(pool.T))
    )
    return with_matches(design, scan, hypotheses, hypotheses[0].T_design_scan, length_mm)


@dataclass(frozen=True, slots=True)
class Pool:
    """T : (h, 4, 4); facing : (h,) +1 or -1 (scan normals turned over); source : (h,) in `_SOURCES`; cost : (h,)"""

    T: FloatArray
    facing: FloatArray
    source: IndexArray
    cost: FloatArray

    def take(self, index: IndexArray) -> "Pool":
        return Pool(self.T[index], self.facing[index], self.source[index], self.cost[index])

    def and_then(self, other: "Pool") -> "Pool":
        """The poses of both, by cost; of equal ones these first."""
        both = Pool(*(np.concatenate([getattr(self, name), getattr(other, name)]) for name in self.__slots__))
        return both.take(np.argsort(both.cost, kind="stable"))


def _candidates(
    design: Side,
    scan: Side,
    design_points: FloatArray,
    scan_points: FloatArray,
    length_mm: float,
    settings: MatchingSettings,
) -> Pool:
    design_fpfh, scan_fpfh = design.described(length_mm, settings), scan.described(length_mm, settings)
    scan_normals, design_normals = scan.mesh.vertex_normals(), design.mesh.vertex_normals()
    pools: list[tuple[FloatArray, float, int]] = []

    def from_pairs(
        scan_vertex: IndexArray, design_vertex: IndexArray, candidates: int, facing: float
    ) -> FloatArray:
        described = scan_fpfh if facing > 0 else turned_over(scan_fpfh)
        i, j = _nearest_descriptors(described[scan_vertex], design_fpfh[design_vertex], candidates)
        i, j = scan_vertex[i], design_vertex[j]
        return poses.from_oriented_pairs(
            (scan.mesh.vertices[i], facing * scan_normals[i]),
            (design.mesh.vertices[j], design_normals[j]),
            length_tolerance_mm=1.5 * length_mm,
            min_length_mm=4 * length_mm,
            max_pairs=settings.max_pairs,
        )

    spread = sampling.farthest(scan.mesh.vertices, DENSE_POINTS)
    everywhere = sampling.farthest(design.mesh.vertices, 4 * DENSE_POINTS)
    for facing in (1.0, -1.0) if _is_open(scan.mesh) or _is_open(design.mesh) else (1.0,):
        if min(len(design.landmarks.vertex), len(scan.landmarks.vertex)) >= 2:
            strongest = scan.landmarks.vertex[:MOST_LANDMARKS], design.landmarks.vertex[:MOST_LANDMARKS]
            found = from_pairs(*strongest, settings.candidates, facing)
            pools.append((found, facing, 0))
        if settings.dense_pairs:
            pools.append((from_pairs(spread, everywhere, 3, facing), facing, 1))
        if settings.axes_poses or sum(len(found) for found, _, _ in pools) == 0:
            pools.append((poses.from_axes(scan_points, design_points), facing, 2))
    return Pool(
        np.concatenate([found for found, _, _ in pools]),
        np.concatenate([np.full(len(found), facing) for found, facing, _ in pools]),
        np.concatenate([np.full(len(found), number) for found, _, number in pools]),
        np.zeros(sum(len(found) for found, _, _ in pools)),
    )


def _is_open(mesh: Mesh) -> bool:
    return bool(topology.border_vertices(mesh.faces, len(mesh.vertices)).any())


def turned_over(histograms: FloatArray) -> FloatArray:
    """What `fpfh` gives of the same surface with all normals reversed.

    Of the three angles of a pair, theta and phi change sign and alpha stays: their 11 bins are read backwards.
    """
    theta, alpha, phi = histograms[:, :11], histograms[:, 11:22], histograms[:, 22:]
    return np.concatenate([theta[:, ::-1], alpha, phi[:, ::-1]], axis=1)


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
    return np.repeat(np.arange(len(scan_fpfh)), k), k_nearest(design_fpfh, scan_fpfh, k).ravel()


def with_matches(
    design: Side, scan: Side, hypotheses: tuple[Hypothesis, ...], T_design_scan: FloatArray, length_mm: float
) -> Matching:
    """Landmarks that are each other's nearest under `T_design_scan`, within `length_mm`."""
    nobody = np.zeros(0, dtype=np.int64)
    q, p = design.landmarks.position_mm, rigid.transformed(T_design_scan, scan.landmarks.position_mm)
    if len(q) == 0 or len(p) == 0:
        return Matching(hypotheses, None, nobody, nobody)
    distance, to_design = nearest(q, p)
    _, to_scan = nearest(p, q)
    mutual = (to_scan[to_design] == np.arange(len(p))) & (distance <= length_mm)
    i = np.flatnonzero(mutual)
    j = to_design[i]
    T = rigid.fit(scan.landmarks.position_mm[i], q[j]) if _spans_a_plane(q[j], length_mm) else None
    return Matching(hypotheses, T, j, i)


def _spans_a_plane(points: FloatArray, length_mm: float) -> bool:
    """Whether the points fix a rotation: three or more, and not within `length_mm` of one line."""
    if len(points) < 3:
        return False
    spread = np.linalg.svd(points - points.mean(axis=0), compute_uv=False) / np.sqrt(len(points))
    return bool(spread[1] > length_mm)


def corners(mesh: Mesh) -> FloatArray:
    """(8, 3) of its bounding box."""
    low, high = mesh.vertices.min(axis=0), mesh.vertices.max(axis=0)
    grid = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)], dtype=np.float64)
    return np.asarray(low + grid * (high - low), dtype=np.float64)
