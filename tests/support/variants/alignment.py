"""The rigid pose in which a part of another shape lies closest to the design.

A part that is changed everywhere has no true pose. What a scan of it can show is what remains in its best
one. Found by ICP from the pose given and from the rotations of the cube, in the axes of the meshes and in
their principal axes: no part of the pipeline's own pose search.
"""

import numpy as np
from scipy.spatial.transform import Rotation

from pipeline.core.mesh import FloatArray, Mesh
from pipeline.kernels import icp, rigid, sampling
from pipeline.kernels.surface import Surface
from tests.support.variants.difference import SurfaceDifference, difference

#: Samples for the coarse steps from every start and for the last steps.
COARSE_SAMPLES, FINE_SAMPLES = 400, 4000
#: Poses that are refined to the end.
REFINED_POSES = 4
#: Correspondence distances of the coarse and of the fine steps, shares of the design's diagonal.
COARSE_REACH, FINE_REACH = 0.15, 0.1


def best_pose(design: Mesh, part: Mesh, *, from_anywhere: bool) -> tuple[FloatArray, SurfaceDifference]:
    """(4, 4) T_design_part that leaves the smallest difference (RMS, both directions) of those found, and
    that difference.

    from_anywhere : start from all rotations, not only from where the part is
    """
    samples, surface = sampling.on_surface(part, FINE_SAMPLES, 0), Surface(design)
    poses = [np.eye(4)]
    if from_anywhere:
        poses += _coarse(design, part)
    weights = np.full(FINE_SAMPLES, 1.0 / FINE_SAMPLES)
    refined = [
        icp.refine(
            *(samples.points, samples.normals, weights, surface, T),
            max_distance_mm=FINE_REACH * design.diagonal_mm,
            max_iterations=40,
            tolerance_mm=1e-5 * design.diagonal_mm,
        ).T_target_source
        for T in poses
    ]
    candidates = [(T, difference(design, part.moved(T))) for T in [np.eye(4), *refined]]
    return min(candidates, key=lambda each: each[1].rms_mm)


def _coarse(design: Mesh, part: Mesh) -> list[FloatArray]:
    """The best of all starts after a few steps."""
    chosen = [sampling.on_surface(mesh, COARSE_SAMPLES, 0) for mesh in (part, design)]
    dense = sampling.on_surface(design, FINE_SAMPLES, 0)
    centres, axes = zip(*(_principal_axes(each.points) for each in chosen), strict=True)
    cube = Rotation.create_group("O").as_matrix()
    turns = [*cube, *(axes[1] @ R @ axes[0].T for R in cube)]
    starts = np.stack([rigid.rotation_about(R, centres[0], centres[1]) for R in turns])
    T, cost = icp.Target(dense.points, dense.normals).refine_many(
        chosen[0].points,
        chosen[0].normals,
        starts,
        np.ones(len(starts)),
        max_distance_mm=COARSE_REACH * design.diagonal_mm,
        iterations=12,
    )
    return list(T[np.argsort(cost, kind="stable")[:REFINED_POSES]])


def _principal_axes(points: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Centroid (3,) and right-handed principal axes (3, 3) in columns."""
    centre = points.mean(axis=0)
    _, _, rows = np.linalg.svd(points - centre, full_matrices=False)
    rows[2] *= np.linalg.det(rows)
    return centre, rows.T
