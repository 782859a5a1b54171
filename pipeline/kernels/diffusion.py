"""Averaging along the surface by heat flow, with a physical radius that does not depend on the triangulation.

Implicit steps on the cotangent Laplacian (Desbrun, Meyer, Schroeder, Barr, "Implicit fairing of irregular
meshes using diffusion and curvature flow", 1999): one sparse factorisation for any radius.
"""

import numpy as np
from scipy.sparse import diags
from scipy.sparse.linalg import splu

from pipeline.core.mesh import FloatArray, Mesh
from pipeline.kernels import curvature

#: Smallest mass of a vertex, as a share of the mean vertex area: a vertex without a triangle keeps its value.
#: Chosen by hand, not fitted.
_MIN_AREA_SHARE = 1e-9


def diffused(mesh: Mesh, values: FloatArray, radius_mm: float, steps: int = 2) -> FloatArray:
    """(n, k): `values` (n, k) after diffusion along the surface; the kernel is about exp(-(d / radius)^2).

    Heat flow for the time radius^2 / 4 in `steps` implicit steps (A - t L) u' = A u (Desbrun et al. 1999,
    with lumped mass A and cotangent Laplacian L), with natural boundary conditions: constants and
    area-weighted sums are preserved. A single step has a kernel with a long tail and a sharp peak; more steps
    approach the Gaussian kernel.
    """
    areas = mesh.vertex_areas_mm2()
    mass = np.maximum(areas, _MIN_AREA_SHARE * max(float(areas.mean()), 1e-300))
    step = radius_mm**2 / 4.0 / steps
    solver = splu((diags(mass) - step * curvature.cotangent_laplacian(mesh)).tocsc())
    # One column at a time: several columns are solved with a threaded product whose last bits depend on the
    # number of threads.
    columns = []
    for column in np.asarray(values, dtype=np.float64).T:
        for _ in range(steps):
            column = solver.solve(mass * column)
        columns.append(column)
    return np.stack(columns, axis=1)
