"""Candidate poses: from pairs of oriented correspondences, from principal axes, and from motions of known
poses.
"""

import itertools
import os
from collections.abc import Sequence

import numpy as np

from pipeline.core.mesh import FloatArray, IndexArray
from pipeline.kernels import rigid
from pipeline.kernels.native import core

#: Max difference of the cosines of corresponding angles in two oriented pairs. Chosen by hand; not fitted.
MAX_ANGLE_COS = 0.35
#: Min sine of the angle between the summed normals of a pair and its line; below, the frame is undefined.
#: Chosen by hand; not fitted.
MIN_TILT = 0.2


def pair_frames(p: FloatArray, q: FloatArray, p_normal: FloatArray, q_normal: FloatArray) -> FloatArray:
    """(k, 3, 3) orthonormal frames of oriented point pairs p -> q.

    p, q : (k, 3) mm; p_normal, q_normal : (k, 3) unit. Columns: along p -> q, across, and the mean normal
    orthogonalised against the first.
    """
    along = q - p
    along = along / np.maximum(np.linalg.norm(along, axis=1, keepdims=True), 1e-300)
    mean_normal = p_normal + q_normal
    up = mean_normal - np.einsum("kd,kd->k", mean_normal, along)[:, None] * along
    up = up / np.maximum(np.linalg.norm(up, axis=1, keepdims=True), 1e-300)
    return np.asarray(np.stack([along, np.cross(up, along), up], axis=2), dtype=np.float64)


def from_oriented_pairs(
    scan: tuple[FloatArray, FloatArray],
    design: tuple[FloatArray, FloatArray],
    *,
    length_tolerance_mm: float,
    min_length_mm: float,
    max_pairs: int,
    max_angle_cos: float = MAX_ANGLE_COS,
) -> FloatArray:
    """(h, 4, 4) T_design_scan of every two correspondences that agree geometrically.

    scan, design : points (c, 3) mm and unit normals (c, 3), each in its own frame; row i of one corresponds
    to row i of the other. Two correspondences agree when the distances between their points, the angles
    between their normals, and the angles of the normals to the connecting line are similar. Two oriented
    points determine a pose. If more than `max_pairs` agree, those with the best agreement are returned (ties
    by index).
    """
    (p, n), (q, m) = scan, design
    p, n, q, m = (np.ascontiguousarray(each, dtype=np.float64) for each in (p, n, q, m))
    threads = len(os.sched_getaffinity(0))
    i, j, disagreement = core.agreeing_pairs(
        p, n, q, m, length_tolerance_mm, min_length_mm, max_angle_cos, MIN_TILT, threads
    )
    best = np.argsort(disagreement, kind="stable")[:max_pairs]
    return _between(p, q, n, m, np.asarray(i)[best], np.asarray(j)[best])


def _between(
    p: FloatArray, q: FloatArray, n: FloatArray, m: FloatArray, i: IndexArray, j: IndexArray
) -> FloatArray:
    F_scan = pair_frames(p[i], p[j], n[i], n[j])
    F_design = pair_frames(q[i], q[j], m[i], m[j])
    R = np.einsum("kia,kja->kij", F_design, F_scan)
    middle_scan, middle_design = (p[i] + p[j]) / 2, (q[i] + q[j]) / 2
    return rigid.compose(R, middle_design - np.einsum("kij,kj->ki", R, middle_scan))


def from_axes(scan: FloatArray, design: FloatArray) -> FloatArray:
    """(24, 4, 4) T_design_scan that align the principal axes, in every order and direction (proper rotations
    only).

    scan, design : (k, 3) mm, points that sample both surfaces evenly.
    """
    (scan_mean, scan_axes), (design_mean, design_axes) = _axes(scan), _axes(design)
    found = []
    for order in itertools.permutations(range(3)):
        for signs in itertools.product((1.0, -1.0), repeat=3):
            permutation = np.zeros((3, 3))
            permutation[list(order), range(3)] = signs
            if np.linalg.det(permutation) > 0:
                R = design_axes @ permutation @ scan_axes.T
                found.append(rigid.rotation_about(R, scan_mean, design_mean))
    return np.array(found)


def _axes(points: FloatArray) -> tuple[FloatArray, FloatArray]:
    mean = points.mean(axis=0)
    covariance = np.einsum("ki,kj->ij", points - mean, points - mean)
    axes = np.linalg.eigh(covariance)[1]
    axes[:, 2] *= np.sign(np.linalg.det(axes))
    return mean, axes


def distinct(
    T: FloatArray,
    order: IndexArray,
    probes: FloatArray,
    apart_mm: float,
    most: int,
    symmetries: Sequence[FloatArray] = (),
    normal_sign: FloatArray | None = None,
) -> IndexArray:
    """Indices of poses in `order` that differ from every earlier one by at least `apart_mm`; at most `most`.

    T : (h, 4, 4); order : (h,) indices, best first; probes : (k, 3) mm, source points over which the RMS
    difference is taken; symmetries : (4, 4) each, of the target. A pose equivalent to an earlier one by a
    symmetry is dropped too. normal_sign : (h,) poses of different signs are different however near they are:
    the scan of one face of a thin wall lies on one face or on the other.
    """
    sign = np.ones(len(T)) if normal_sign is None else normal_sign
    kept = core.distinct(
        np.ascontiguousarray(T[order]),
        np.ascontiguousarray(sign[order], dtype=np.float64),
        np.ascontiguousarray(probes, dtype=np.float64),
        apart_mm,
        most,
        np.array([np.eye(4), *symmetries]),
    )
    return order[np.asarray(kept)]


def perturb(T: FloatArray, points: FloatArray, moved_mm: Sequence[float]) -> FloatArray:
    """(12 m, 4, 4) the pose T (4, 4) followed by a translation along, or a rotation about, each principal
    axis.

    points : (k, 3) mm, source frame; the axes are those of the points under T. moved_mm : m displacements
    (RMS over the points), each made in both directions.
    """
    placed = rigid.transformed(T, points)
    mean, axes = _axes(placed)
    arm = (placed - mean) @ axes
    found = []
    for step_mm in moved_mm:
        for k in range(3):
            lever = max(float(np.sqrt((np.delete(arm, k, axis=1) ** 2).sum(axis=1).mean())), 1e-300)
            for side in (step_mm, -step_mm):
                found.append(rigid.compose(np.eye(3), side * axes[:, k]))
                turn = rigid.from_vector(np.concatenate([side / lever * axes[:, k], np.zeros(3)])[None])[0][
                    :3, :3
                ]
                found.append(rigid.rotation_about(turn, mean))
    return np.array(found) @ T


def iterate_motion(step: FloatArray, most: int) -> FloatArray:
    """(2 most, 4, 4) the powers 1 ... `most` of the motion `step` (4, 4), then those of its inverse."""
    found = []
    for each in (step, rigid.inverse(step)):
        T = np.eye(4)
        for _ in range(most):
            T = rigid.orthonormal(each @ T)
            found.append(T)
    return np.array(found)
