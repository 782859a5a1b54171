"""Computed tomography: a closed surface from voxels, in steps."""

import numpy as np
import pymeshlab

from pipeline.core.mesh import Mesh
from pipeline.core.settings import CleanSettings
from pipeline.stages.clean import clean
from tests.support.scanners.record import SimulatedScan

#: Standard deviation of a uniform error of one voxel: a surface in steps of voxels is off by so much.
STEP_SIGMA = 1 / np.sqrt(12)


def ct(part: Mesh, voxel_mm: float, rng: np.random.Generator) -> SimulatedScan:
    """The surface of a closed part by marching cubes that put every vertex in the middle of its edge."""
    meshes = pymeshlab.MeshSet(verbose=False)
    meshes.add_mesh(pymeshlab.Mesh(part.vertices, part.faces))
    meshes.generate_resampled_uniform_mesh(
        cellsize=pymeshlab.PureValue(voxel_mm), mergeclosevert=True, discretize=True
    )
    made = meshes.current_mesh()
    scan = clean(Mesh(made.vertex_matrix(), made.face_matrix()), "scan", CleanSettings()).mesh
    return SimulatedScan.posed(scan, float(STEP_SIGMA * voxel_mm), rng)
