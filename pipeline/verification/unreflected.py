"""A pose that the search missed, from that of the mirror image: a part that is nearly its own mirror image
must not be called mirrored because its own pose was not found.
"""

import numpy as np

from pipeline.analysis.design_model import DesignModel
from pipeline.analysis.scan_registration import RegisteredScan
from pipeline.core.job_parameters import JobParameters
from pipeline.core.mesh import FloatArray
from pipeline.kernels import sampling
from pipeline.search.scan_model import ScanPoints
from pipeline.search.schedule import REGISTRATION
from pipeline.search.types import MIRROR
from pipeline.verification.equivalent_poses import register_from

#: Samples of the design whose principal axes are taken. Chosen by hand.
AXES_SAMPLES = 5_000


def register_unreflected(
    registered: RegisteredScan, T_design_mirrored: FloatArray, design: DesignModel, job: JobParameters
) -> RegisteredScan:
    """Registered anew from the poses that follow from that of the mirror image if the design is symmetric to
    one of its principal planes; the scan as it was where none of them fits better.

    T_design_mirrored : (4, 4) pose of the mirrored scan (`search.types.mirror_mesh`)
    """
    motions = [np.eye(4), *design.symmetry.elements, *design.symmetry.approximate]
    mirror = np.diag([*MIRROR, 1.0])
    poses = [
        motion @ reflection @ T_design_mirrored @ mirror
        for reflection in _principal_reflections(design)
        for motion in motions
    ]
    coarse = ScanPoints.of(registered.scan.mesh, REGISTRATION.coarse_samples, job.seed)
    inlier_mm = registered.registration.inlier_distance_mm
    closest = min(poses, key=lambda T: coarse.evaluate(T, design.surface, inlier_mm).cost_mm2)
    again = register_from(closest, registered, design, job)
    before_mm, after_mm = (each.registration.fit.truncated_rms_mm for each in (registered, again))
    return again if after_mm < before_mm else registered


def _principal_reflections(design: DesignModel) -> list[FloatArray]:
    """(4, 4) each: the reflections in the three principal planes of the design's surface."""
    points = sampling.on_surface(design.surface.mesh, AXES_SAMPLES, 0).points
    centre = points.mean(axis=0)
    axes = np.linalg.eigh(np.einsum("ki,kj->ij", points - centre, points - centre))[1]
    found = []
    for axis in axes.T:
        T = np.eye(4)
        T[:3, :3] -= 2 * np.outer(axis, axis)
        T[:3, 3] = centre - T[:3, :3] @ centre
        found.append(T)
    return found
