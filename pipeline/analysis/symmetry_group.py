"""The symmetries of a design: the motions under which it is its own image, found by registering it to itself.

Every pose of a scan of such a design has equals: as right, and no reason to call the pose ambiguous. An axis
of symmetry is a principal axis, or lies in the plane of two equal ones: turns about those are tried, and what
matching the design to itself finds, which covers parts as round as a cube.
"""

from functools import cached_property

import numpy as np
from scipy.spatial.transform import Rotation

from pipeline.core.mesh import FloatArray
from pipeline.core.settings import MatchingSettings
from pipeline.kernels import icp, poses, rigid, sampling
from pipeline.kernels.nearest_grid import NearestGrid
from pipeline.kernels.surface import Surface
from pipeline.search.hypotheses import box_corners
from pipeline.search.schedule import MATCHING, SYMMETRY
from pipeline.search.types import DescribedMesh
from pipeline.stages.matching import match


class SymmetryGroup:
    """Motions (4, 4), design frame to design frame.

    elements : under which the design is its own image, without the identity; approximate : under which it is
    but for some part of it, where a scan finds alternative poses (a gear with a key, turned by one tooth)
    """

    def __init__(
        self,
        surface: Surface,
        elements: tuple[FloatArray, ...] = (),
        approximate: tuple[FloatArray, ...] = (),
    ) -> None:
        self.elements, self.approximate = elements, approximate
        self._surface = surface
        self._points = sampling.on_surface(surface.mesh, SYMMETRY.samples, 0)
        self._diagonal_mm = surface.mesh.diagonal_mm

    def contains(self, T: FloatArray) -> bool:
        """Whether T (4, 4), estimated from two poses of a noisy scan, is a symmetry: a known one, or one that
        the surface itself confirms.

        A motion near the identity is one only where the surface holds it there: a pose next to another is an
        alternative, not a symmetry.
        """
        if self.same(T, np.eye(4)):
            refined, points = self.refine(T), self._points.points
            if refined is None:
                return False
            size_mm = rigid.rms_displacement(T, np.eye(4), points)
            return rigid.rms_displacement(refined, T, points) < SYMMETRY.small_motion_ratio * size_mm
        return any(self.same(T, each) for each in self.elements) or self.refine(T) is not None

    def refine(self, T: FloatArray) -> FloatArray | None:
        """The motion near T (4, 4) under which the design is its own image, or None."""
        points, normals, diagonal_mm = self._points.points, self._points.normals, self._diagonal_mm
        some = slice(None, None, len(points) // SYMMETRY.icp_samples)
        weights = np.full(len(points[some]), 1.0 / len(points[some]))
        refined = icp.refine(
            *(points[some], normals[some], weights, self._surface, T),
            max_distance_mm=SYMMETRY.icp_truncation_share * diagonal_mm,
            max_iterations=SYMMETRY.icp_iterations,
            tolerance_mm=SYMMETRY.icp_convergence_share * diagonal_mm,
        ).T_target_source
        if not self.same(refined, T):
            return None
        distance = self._surface.closest(rigid.transformed(refined, points)).distance
        is_near = float(np.sqrt((distance**2).mean())) <= SYMMETRY.rms_share * diagonal_mm
        return refined if is_near and float(distance.max()) <= SYMMETRY.max_share * diagonal_mm else None

    def same(self, T: FloatArray, other: FloatArray) -> bool:
        """Whether two motions (4, 4) put the design in nearly the same place."""
        displacement_mm = rigid.rms_displacement(T, other, self._points.points)
        return displacement_mm <= SYMMETRY.same_pose_share * self._diagonal_mm

    def add(self, T: FloatArray) -> None:
        """Add the symmetry near T (4, 4), if there is one that is new and the group has room."""
        is_known = any(self.same(T, each) for each in (np.eye(4), *self.elements))
        if len(self.elements) >= SYMMETRY.max_elements or is_known:
            return
        refined = self.refine(T)
        if refined is not None:
            self.elements += (refined,)

    def close(self) -> None:
        """Add the products of the elements: a product of two symmetries is one."""
        number = 0
        while number < len(self.elements) < SYMMETRY.max_elements:
            for first in self.elements[: number + 1]:
                self.add(self.elements[number] @ first)
                self.add(first @ self.elements[number])
            number += 1


def find_symmetries(
    surface: Surface, design: DescribedMesh, length_mm: float, settings: MatchingSettings, seed: int
) -> SymmetryGroup:
    """The group of a design: candidates from turns and from matching it to itself, each refined and tested.

    surface : of the cleaned design; design : its working mesh; length_mm : unit of length of matching
    """
    group, finder = SymmetryGroup(surface), _CandidateFinder(surface)
    candidates = finder.turns()
    candidates += [
        (each.cost_mm2, each.T_design_scan)
        for each in match(design, design, length_mm, settings, seed).hypotheses
    ]
    for cost_mm2, T in candidates:
        if cost_mm2 <= (SYMMETRY.candidate_rms_share * surface.mesh.diagonal_mm) ** 2:
            group.add(T)
    group.close()
    limit_mm2 = (SYMMETRY.approximate_rms_share * surface.mesh.diagonal_mm) ** 2
    approximate = [T for cost_mm2, T in candidates if cost_mm2 <= limit_mm2]
    group.approximate = finder.close_approximate(approximate, group.elements, limit_mm2)
    return group


class _CandidateFinder:
    """Short ICPs of a design's samples on themselves."""

    def __init__(self, surface: Surface) -> None:
        self._mesh = surface.mesh
        self._diagonal_mm = surface.mesh.diagonal_mm
        self._points = sampling.on_surface(surface.mesh, SYMMETRY.samples, 0)
        self._coarse = slice(None, None, len(self._points.points) // SYMMETRY.coarse_samples)

    def turns(self) -> list[tuple[float, FloatArray]]:
        """Turns about possible axes with their cost (mm^2) after a short ICP, the most promising first."""
        samples = self._points
        T = possible_turns(samples.points)
        truncation_mm = SYMMETRY.rank_truncation_share * self._diagonal_mm
        grid = NearestGrid(samples.points, samples.normals, truncation_mm)
        points, normals = samples.points[self._coarse], samples.normals[self._coarse]
        cost_mm2 = grid.costs(T, np.ones(len(T)), points, normals)
        T, cost_mm2 = self._refine(T[np.argsort(cost_mm2, kind="stable")[: SYMMETRY.max_tried]])
        order = np.argsort(cost_mm2, kind="stable")
        return [(float(cost_mm2[k]), rigid.orthonormal(T[k])) for k in order]

    def close_approximate(
        self, candidates: list[FloatArray], elements: tuple[FloatArray, ...], limit_mm2: float
    ) -> tuple[FloatArray, ...]:
        """`candidates` and their products of a cost up to `limit_mm2`, without the identity and
        `elements`.
        """
        known = np.array([np.eye(4), *elements])
        exact, box = len(known), box_corners(self._mesh)
        apart_mm = MATCHING.neighbour_share * self._diagonal_mm

        def new_ones(T: FloatArray) -> FloatArray:
            both = np.concatenate([known, T])
            max_count = exact + SYMMETRY.max_approximate
            kept = poses.distinct(both, np.arange(len(both)), box, apart_mm, max_count)
            return both[kept[kept >= len(known)]]

        new = new_ones(np.array(candidates).reshape(-1, 4, 4))
        generators = new[: SYMMETRY.generators]
        while len(new):
            known = np.concatenate([known, new])
            new = new_ones(np.concatenate([new @ generator for generator in generators]))
            if len(new):
                new, cost_mm2 = self._refine(new)
                new = new_ones(new[cost_mm2 <= limit_mm2])
        return tuple(rigid.orthonormal(T) for T in known[exact:])

    def _refine(self, T: FloatArray) -> tuple[FloatArray, FloatArray]:
        """After a short ICP on few points: T (h, 4, 4), cost (h,) mm^2."""
        samples, coarse = self._points, self._coarse
        return self._target.refine_many(
            samples.points[coarse],
            samples.normals[coarse],
            T,
            np.ones(len(T)),
            max_distance_mm=SYMMETRY.short_icp_truncation_share * self._diagonal_mm,
            iterations=SYMMETRY.short_icp_iterations,
        )

    @cached_property
    def _target(self) -> icp.Target:
        return icp.Target(self._points.points, self._points.normals)


def possible_turns(points: FloatArray) -> FloatArray:
    """(k, 4, 4) about the centroid of `points` (n, 3): n-fold turns about the principal axes, and half turns
    about axes between equal ones.
    """
    centre = points.mean(axis=0)
    covariance = np.einsum("ki,kj->ij", points - centre, points - centre) / len(points)
    variance, axes = np.linalg.eigh(covariance)
    turns = [2 * np.pi / n * axes[:, k] for k in range(3) for n in range(2, SYMMETRY.max_fold + 1)]
    for i, j in ((0, 1), (1, 2), (0, 2)):
        if variance[j] - variance[i] <= SYMMETRY.equal_axes_ratio * variance[2]:
            angles = np.radians(np.arange(SYMMETRY.half_turn_step_deg, 180.0, SYMMETRY.half_turn_step_deg))
            turns += [np.pi * (np.cos(angle) * axes[:, i] + np.sin(angle) * axes[:, j]) for angle in angles]
    R = Rotation.from_rotvec(np.array(turns)).as_matrix()
    return rigid.rotation_about(R, centre)
