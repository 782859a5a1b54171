"""Under which motions a design is its own image, found by registering it to itself.

Every pose of a scan of such a design has equals: as right, and no reason to call the pose ambiguous. An axis of symmetry is a
principal axis, or lies in the plane of two that are equal: turns about those are tried, and what matching the design to itself
finds, which covers parts as round as a cube.
"""

from functools import cached_property

import numpy as np
from scipy.spatial import cKDTree
from scipy.spatial.transform import Rotation

from pipeline.core.mesh import FloatArray
from pipeline.core.settings import MatchingSettings
from pipeline.kernels import icp, poses, rigid, sampling
from pipeline.kernels.nearest_grid import NearestGrid
from pipeline.kernels.surface import Surface
from pipeline.stages.matching import NEXT_SHARE, Side, corners, match

RMS_SHARE = 0.0005  # of the diagonal: a design moved onto itself this near is symmetric under the motion,
MAX_SHARE = 0.003  # and nowhere farther off than this: a hole in another place is a small RMS
NEAR_SHARE = 0.003  # of the diagonal: a hypothesis that leaves more after its short ICP is none
SAME_POSE_SHARE = 0.02
LARGEST_GROUP = 24  # of n-fold parts; a body of revolution has no end
POINTS, ICP_POINTS, FEW_POINTS = 10_000, 1_500, 300
LARGEST_FOLD = 12
EQUAL_AXES = 0.05  # of the largest variance: nearer ones may be equal
HALF_TURNS_DEG = 5.0  # apart: within the reach of an ICP
COARSE_SHARE, REFINE_SHARE = (
    0.04,
    0.02,
)  # of the diagonal: truncation of the quick judgement, and of the short ICP
TRIED = 16
ALIKE_SHARE = (
    0.008  # of the diagonal: what leaves less may be taken for the design by a scan, or of a part of it
)
GENERATORS, MOST_NEAR = 6, 96


class SelfImages:
    """The motions (4, 4), design to design, under which it is its own image; `others` : without the identity; `near` : those
    under which it is but for some part of it, where a scan will find its rivals: a gear with a key, one tooth on
    """

    def __init__(
        self, surface: Surface, others: tuple[FloatArray, ...] = (), near: tuple[FloatArray, ...] = ()
    ) -> None:
        self.others, self.near = others, near
        self._surface = surface
        self._samples = sampling.on_surface(surface.mesh, POINTS, 0)
        self._diagonal = surface.mesh.diagonal_mm

    @classmethod
    def of(
        cls, surface: Surface, design: Side, length_mm: float, settings: MatchingSettings, seed: int
    ) -> "SelfImages":
        """Turns and hypotheses, each refined and tested; products of two are motions of it too."""
        images = cls(surface)
        nearly = images._promising_turns()
        nearly += [
            (each.cost_mm2, each.T_design_scan)
            for each in match(design, design, length_mm, settings, seed).hypotheses
        ]
        for cost_mm2, T in nearly:
            if cost_mm2 <= (NEAR_SHARE * images._diagonal) ** 2:
                images._add(T)
        number = 0
        while number < len(images.others) < LARGEST_GROUP:
            for first in images.others[: number + 1]:
                images._add(images.others[number] @ first)
                images._add(first @ images.others[number])
            number += 1
        alike = (ALIKE_SHARE * images._diagonal) ** 2
        images.near = images._closed([T for cost_mm2, T in nearly if cost_mm2 <= alike], alike)
        return images

    def contains(self, T: FloatArray) -> bool:
        """Whether T (4, 4), as two poses of a noisy scan tell it, is one of them: known, or shown by the surface itself.

        A small motion is none unless the surface holds it there: a pose next to another is its rival.
        """
        if self.same(T, np.eye(4)):
            found, points = self.refined(T), self._samples.points
            if found is None:
                return False
            return rigid.rms_displacement(found, T, points) < 0.5 * rigid.rms_displacement(
                T, np.eye(4), points
            )
        return any(self.same(T, each) for each in self.others) or self.refined(T) is not None

    def refined(self, T: FloatArray) -> FloatArray | None:
        """The motion near T (4, 4) under which the design is its own image, or None."""
        points, normals, diagonal = self._samples.points, self._samples.normals, self._diagonal
        few = slice(None, None, len(points) // ICP_POINTS)
        weights = np.full(len(points[few]), 1.0 / len(points[few]))
        done = icp.refine(
            *(points[few], normals[few], weights, self._surface, T),
            max_distance_mm=0.02 * diagonal,
            max_iterations=30,
            tolerance_mm=1e-6 * diagonal,
        ).T_target_source
        if not self.same(done, T):
            return None
        distance = self._surface.closest(rigid.transformed(done, points)).distance
        near = float(np.sqrt((distance**2).mean())) <= RMS_SHARE * diagonal
        return done if near and float(distance.max()) <= MAX_SHARE * diagonal else None

    def _promising_turns(self) -> list[tuple[float, FloatArray]]:
        """Of all turns about possible axes those that may hold, with what they leave after a short ICP, mm^2."""
        samples, diagonal = self._samples, self._diagonal
        few = slice(None, None, len(samples.points) // FEW_POINTS)
        points, normals = samples.points[few], samples.normals[few]
        T = _turns(samples.points)
        facing = np.ones(len(T))
        grid = NearestGrid(samples.points, samples.normals, COARSE_SHARE * diagonal)
        cost = grid.costs(T, facing, points, normals, COARSE_SHARE * diagonal)
        tried = np.argsort(cost, kind="stable")[:TRIED]
        T, cost = self._briefly(T[tried])
        return [(float(cost[k]), rigid.orthonormal(T[k])) for k in np.argsort(cost, kind="stable")]

    def _briefly(self, T: FloatArray) -> tuple[FloatArray, FloatArray]:
        """After a short ICP on few points: T (h, 4, 4), and what is left (h,) mm^2."""
        samples = self._samples
        few = slice(None, None, len(samples.points) // FEW_POINTS)
        limit_mm = REFINE_SHARE * self._diagonal
        return icp.refine_many(
            *(samples.points[few], samples.normals[few], self._target, T, np.ones(len(T))),
            max_distance_mm=limit_mm,
            iterations=10,
        )

    @cached_property
    def _target(self) -> icp.Target:
        return icp.Target(cKDTree(self._samples.points), self._samples.points, self._samples.normals)

    def _closed(self, found: list[FloatArray], alike_mm2: float) -> tuple[FloatArray, ...]:
        """`found` and their products that leave no more than `alike_mm2`; the identity and `others` are none of them."""
        known = np.array([np.eye(4), *self.others])
        exact, box, apart_mm = len(known), corners(self._surface.mesh), NEXT_SHARE * self._diagonal

        def distinct(new: FloatArray) -> FloatArray:
            both = np.concatenate([known, new])
            kept = poses.distinct(both, np.arange(len(both)), box, apart_mm, exact + MOST_NEAR)
            return both[kept[kept >= len(known)]]

        new = distinct(np.array(found).reshape(-1, 4, 4))
        generators = new[:GENERATORS]
        while len(new):
            known = np.concatenate([known, new])
            new = distinct(np.concatenate([new @ generator for generator in generators]))
            if len(new):
                new, cost = self._briefly(new)
                new = distinct(new[cost <= alike_mm2])
        return tuple(rigid.orthonormal(T) for T in known[exact:])

    def _add(self, T: FloatArray) -> None:
        if len(self.others) >= LARGEST_GROUP or any(self.same(T, each) for each in (np.eye(4), *self.others)):
            return
        refined = self.refined(T)
        if refined is not None:
            self.others += (refined,)

    def same(self, T: FloatArray, other: FloatArray) -> bool:
        """Whether the two motions put the design nearly in one place."""
        return rigid.rms_displacement(T, other, self._samples.points) <= SAME_POSE_SHARE * self._diagonal


def _turns(points: FloatArray) -> FloatArray:
    """(k, 4, 4) about the centroid of `points`: n-fold turns about principal axes, half turns about axes between equal ones."""
    centre = points.mean(axis=0)
    variance, axes = np.linalg.eigh(np.einsum("ki,kj->ij", points - centre, points - centre) / len(points))
    turns = [2 * np.pi / n * axes[:, k] for k in range(3) for n in range(2, LARGEST_FOLD + 1)]
    for i, j in ((0, 1), (1, 2), (0, 2)):
        if variance[j] - variance[i] <= EQUAL_AXES * variance[2]:
            angles = np.radians(np.arange(HALF_TURNS_DEG, 180.0, HALF_TURNS_DEG))
            turns += [np.pi * (np.cos(angle) * axes[:, i] + np.sin(angle) * axes[:, j]) for angle in angles]
    R = Rotation.from_rotvec(np.array(turns)).as_matrix()
    return rigid.rotation_about(R, centre)
