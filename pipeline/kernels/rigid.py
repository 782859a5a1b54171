"""Rigid motions as 4 x 4 homogeneous matrices: `p_target = T_target_source @ p_source`. Lengths in mm."""

import numpy as np

from pipeline.core.mesh import FloatArray


def transformed(T_target_source: FloatArray, points: FloatArray) -> FloatArray:
    """`points` (k, 3) under one motion (4, 4): (k, 3); or under each of (h, 4, 4): (h, k, 3)."""
    R, t = T_target_source[..., :3, :3], T_target_source[..., None, :3, 3]
    return rotated(R, points) + t


def rotated(R: FloatArray, vectors: FloatArray) -> FloatArray:
    """`vectors` (k, 3) under one rotation (3, 3): (k, 3); or under each of (h, 3, 3): (h, k, 3)."""
    flat = np.ascontiguousarray(R).reshape(-1, 3) @ vectors.T  # one product for all poses
    return np.swapaxes(flat.reshape(*R.shape[:-2], 3, len(vectors)), -1, -2)


def compose(R: FloatArray, t: FloatArray) -> FloatArray:
    """(..., 4, 4) from rotations (..., 3, 3) and translations (..., 3)."""
    T = np.zeros((*R.shape[:-2], 4, 4))
    T[..., :3, :3], T[..., :3, 3], T[..., 3, 3] = R, t, 1.0
    return T


def rotation_about(R: FloatArray, centre: FloatArray, image: FloatArray | None = None) -> FloatArray:
    """(4, 4) the motion with rotation R (3, 3) that takes the point `centre` (3,) to `image` (3,).

    Without `image` the centre stays where it is: p -> R (p - centre) + centre.
    """
    return compose(R, (centre if image is None else image) - R @ centre)


def inverse(T: FloatArray) -> FloatArray:
    """(..., 4, 4) the inverse motions of T (..., 4, 4)."""
    R, t = T[..., :3, :3], T[..., :3, 3]
    back = np.swapaxes(R, -1, -2)
    return compose(back, -np.einsum("...ij,...j->...i", back, t))


def from_vector(x: FloatArray) -> FloatArray:
    """(h, 4, 4) motions of rotation vectors (radians) and translations, x : (h, 6), by Rodrigues' formula."""
    angle = np.linalg.norm(x[:, :3], axis=1)
    axis = x[:, :3] / np.maximum(angle, 1e-300)[:, None]
    K = np.zeros((len(x), 3, 3))
    K[:, 0, 1], K[:, 0, 2], K[:, 1, 2] = -axis[:, 2], axis[:, 1], -axis[:, 0]
    K[:, 1, 0], K[:, 2, 0], K[:, 2, 1] = axis[:, 2], -axis[:, 1], axis[:, 0]
    s, c = np.sin(angle)[:, None, None], (1 - np.cos(angle))[:, None, None]
    return compose(np.eye(3) + s * K + c * np.einsum("hij,hjk->hik", K, K), x[:, 3:])


def rotation_vector(T: FloatArray) -> FloatArray:
    """(3,) axis times angle (radians, below pi) of the rotation of T (4, 4)."""
    R = T[:3, :3]
    sine = 0.5 * np.array([R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1]])
    length = float(np.linalg.norm(sine))
    angle = np.arctan2(length, 0.5 * (np.trace(R) - 1))
    return np.asarray(sine * (angle / length if length > 0 else 1.0))


def orthonormal(T: FloatArray) -> FloatArray:
    """(4, 4) the nearest proper rigid motion to T (4, 4): removes the rounding error of many products."""
    u, _, vt = np.linalg.svd(T[:3, :3])
    u[:, 2] *= np.sign(np.linalg.det(u @ vt))
    return compose(u @ vt, T[:3, 3])


def fit(source: FloatArray, target: FloatArray, weights: FloatArray | None = None) -> FloatArray:
    """(4, 4) T_target_source, the weighted least-squares motion between corresponding points.

    source, target : (k, 3), k >= 3; weights : (k,) >= 0, default equal. For points on one line the
    rotation about that line is arbitrary. Kabsch (1976); Umeyama (1991), without scale.
    """
    w = np.full(len(source), 1.0 / len(source)) if weights is None else weights / weights.sum()
    source_mean, target_mean = np.einsum("k,kd->d", w, source), np.einsum("k,kd->d", w, target)
    covariance = np.einsum("k,ki,kj->ij", w, target - target_mean, source - source_mean)
    u, _, vt = np.linalg.svd(covariance)
    flip = np.diag([1.0, 1.0, np.sign(np.linalg.det(u @ vt))])
    R = u @ flip @ vt
    return rotation_about(R, source_mean, target_mean)


def angle_deg(T: FloatArray) -> float:
    """Rotation angle of T (4, 4) in degrees, 0 to 180; accurate near both ends."""
    R = T[:3, :3]
    sine = 0.5 * float(np.linalg.norm([R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1]]))
    return float(np.degrees(np.arctan2(sine, 0.5 * (np.trace(R) - 1))))


def rms_displacement(T_a: FloatArray, T_b: FloatArray, points: FloatArray) -> float:
    """RMS distance in mm between `points` (k, 3) under T_a and under T_b (4, 4): the difference of two
    poses.
    """
    difference = transformed(T_a, points) - transformed(T_b, points)
    return float(np.sqrt((difference**2).sum(axis=-1).mean()))


def share_of(motion: FloatArray, centre: FloatArray, share: float) -> FloatArray:
    """(4, 4) a share of a small motion (4, 4) about a centre (3,), mm."""
    if share == 1.0:
        return motion
    twist = rotation_vector(motion)
    turn = from_vector(np.concatenate([share * twist, np.zeros(3)])[None])[0][:3, :3]
    slide = transformed(motion, centre[None])[0] - centre
    return rotation_about(turn, centre, centre + share * slide)
