"""From thousands of candidate poses to a dozen distinct hypotheses: rank, refine by short ICPs, look at
neighbours.

The schedule (how many points, how many iterations, how many go on) is data: `search.schedule.MATCHING`.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from pipeline.core.mesh import FloatArray, Mesh
from pipeline.core.settings import MatchingSettings
from pipeline.kernels import icp, poses, rigid, sampling
from pipeline.kernels.nearest_grid import NearestGrid
from pipeline.search.schedule import MATCHING, RefineRound
from pipeline.search.types import SOURCES, Hypothesis, PosePool


class HypothesisSearch:
    """One scan on one design. `symmetries` : (4, 4) each, design to design; of poses that differ by one of
    them one is kept, so that the images of one pose do not crowd out others. `approximate` : motions under
    which the design is nearly its own image, where alternatives are expected.
    """

    def __init__(
        self,
        design: Mesh,
        scan: Mesh,
        settings: MatchingSettings,
        seed: int,
        symmetries: tuple[FloatArray, ...],
        approximate: tuple[FloatArray, ...],
    ) -> None:
        self._settings, self._symmetries, self._approximate = settings, symmetries, approximate
        self._diagonal_mm = design.diagonal_mm
        self._box = box_corners(scan)
        self.design_samples = sampling.on_surface(design, MATCHING.design_samples, seed)
        self.scan_samples = sampling.on_surface(scan, settings.sample_points, seed + 1)
        coarse_step = max(1, len(self.scan_samples.points) // MATCHING.coarse_samples)
        self._fine, self._coarse = slice(None), slice(None, None, coarse_step)
        self._coarsest = slice(None, None, 4 * coarse_step)
        points, normals = self.design_samples.points, self.design_samples.normals
        self._target = icp.Target(points, normals)
        self._grid = NearestGrid(points, normals, MATCHING.rank_truncation_share * self._diagonal_mm)

    def run(self, candidates: PosePool) -> tuple[Hypothesis, ...]:
        """Distinct poses, best first, the neighbours of the best among them. candidates : at least one"""
        pool = self._select(candidates)
        pool = self._refine_rounds(pool, MATCHING.rounds)
        if pool.cost_mm2.min() <= (MATCHING.hopeless_share * self._diagonal_mm) ** 2:
            neighbours = self._neighbours(pool)
            periodic = self._propagate_periodicity(pool, neighbours)
            pool = pool.merge(neighbours).merge(periodic)
        return tuple(
            Hypothesis(
                rigid.orthonormal(pool.T[k]),
                float(pool.normal_sign[k]),
                float(pool.cost_mm2[k]),
                SOURCES[pool.source[k]],
            )
            for k in range(len(pool.T))
        )

    def _select(self, pool: PosePool) -> PosePool:
        """The distinct poses of lowest cost, before any ICP: on very few points, then on few."""
        by_cost = np.argsort(self._rank(pool, self._coarsest), kind="stable")
        pool = pool.take(np.sort(by_cost[: 2 * MATCHING.max_ranked]))
        return self._keep_distinct(pool, self._rank(pool, self._coarse), self._settings.max_hypotheses)

    def _refine_rounds(self, pool: PosePool, rounds: Sequence[RefineRound]) -> PosePool:
        for each in rounds:
            pool = self._refine(pool, each)
            if each.keep is not None:
                pool = self._keep_distinct(pool, pool.cost_mm2, each.keep)
        return pool

    def _neighbours(self, pool: PosePool) -> PosePool:
        """Poses next to the best that fit too: one tooth or one hole further on a rack or a gear."""
        shifts_mm = [share * self._diagonal_mm for share in MATCHING.perturbations_share]
        around = PosePool.around(
            poses.perturb(pool.T[0], self.scan_samples.points[self._coarse], shifts_mm), pool
        )
        return self._refine_new(around, MATCHING.neighbour_rounds, pool)

    def _propagate_periodicity(self, pool: PosePool, neighbours: PosePool) -> PosePool:
        """Repeats the step to each neighbour, and applies the approximate symmetries: any tooth may be the
        right one.
        """
        T_back = rigid.inverse(pool.T[0])
        steps = neighbours.take(np.argsort(neighbours.cost_mm2, kind="stable")[: MATCHING.periodic_steps])
        repeats = MATCHING.periodic_repeats
        motions = [
            *self._approximate,
            *(T for step in steps.T for T in poses.iterate_motion(step @ T_back, repeats)),
        ]
        if not motions:
            return pool.first(0)
        known = pool.merge(neighbours)
        shifted = PosePool.around(np.array(motions) @ pool.T[0], pool)
        shifted = self._new(replace(shifted, cost_mm2=self._rank(shifted, self._fine)), known)
        return self._refine_new(shifted.first(MATCHING.max_periodic), MATCHING.periodic_rounds, known)

    def _refine_new(self, pool: PosePool, rounds: Sequence[RefineRound], known: PosePool) -> PosePool:
        """Refined round by round; what has moved onto a known pose is dropped after each."""
        for each in rounds:
            if len(pool.T) == 0:
                break
            pool = self._new(self._refine(pool, each), known)
            pool = pool if each.keep is None else pool.first(each.keep)
        return pool

    def _rank(self, pool: PosePool, samples: slice) -> FloatArray:
        """(h,) mm^2, cost of each pose by the grid of nearest samples, without an ICP."""
        points, normals = self.scan_samples.points[samples], self.scan_samples.normals[samples]
        return self._grid.costs(pool.T, pool.normal_sign, points, normals)

    def _refine(self, pool: PosePool, settings: RefineRound) -> PosePool:
        samples = self._coarse if settings.samples == "coarse" else self._fine
        T, cost_mm2 = self._target.refine_many(
            self.scan_samples.points[samples],
            self.scan_samples.normals[samples],
            pool.T,
            pool.normal_sign,
            max_distance_mm=settings.truncation_share * self._diagonal_mm,
            iterations=settings.iterations,
        )
        return replace(pool, T=T, cost_mm2=cost_mm2)

    def _keep_distinct(self, pool: PosePool, cost_mm2: FloatArray, count: int) -> PosePool:
        order = np.argsort(cost_mm2, kind="stable")[: MATCHING.max_ranked]
        apart_mm = MATCHING.distinct_share * self._diagonal_mm
        return pool.take(
            poses.distinct(pool.T, order, self._box, apart_mm, count, self._symmetries, pool.normal_sign)
        )

    def _new(self, pool: PosePool, known: PosePool) -> PosePool:
        """Those of `pool` that are none of `known`, each once, lowest cost first."""
        T = np.concatenate([known.T, pool.T])
        order = np.argsort(pool.cost_mm2, kind="stable")
        order = np.concatenate([np.arange(len(known.T)), len(known.T) + order])
        apart_mm = MATCHING.neighbour_share * self._diagonal_mm
        sign = np.concatenate([known.normal_sign, pool.normal_sign])
        kept = poses.distinct(T, order, self._box, apart_mm, len(order), self._symmetries, sign)
        return pool.take(kept[kept >= len(known.T)] - len(known.T))


def box_corners(mesh: Mesh) -> FloatArray:
    """(8, 3) corners of its axis-aligned bounding box, mm."""
    low, high = mesh.vertices.min(axis=0), mesh.vertices.max(axis=0)
    grid = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)], dtype=np.float64)
    return np.asarray(low + grid * (high - low), dtype=np.float64)
