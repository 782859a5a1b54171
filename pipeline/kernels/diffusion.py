"""Averaging along the surface by heat flow, which knows a physical radius and nothing of the triangles.

Implicit steps on the cotangent Laplacian (Desbrun, Meyer, Schroeder, Barr, "Implicit fairing of irregular
meshes using diffusion and curvature flow", 1999): one sparse factorisation, whatever the radius.
"""

import numpy as np
from scipy.sparse import diags
from scipy.sparse.linalg import splu

from pipeline.core.mesh import FloatArray, Mesh
from pipeline.kernels import curvature

_MIN_AREA_SHARE = 1e-9  # of the mean vertex area: a vertex without a triangle keeps its own value


def diffused(mesh: Mesh, values: FloatArray, radius_mm: float, steps: int = 2) -> FloatArray:
    """(n, k) `values` (n, k) after diffusion along the surface by about the kernel exp(-(d / radius)^2).

    Heat flow for the time radius^2 / 4 in implicit steps (A - t L) u' = A u, natural conditions at borders:
    constants stay, area-weighted sums stay. One step alone leaves a long tail and a peak at its source, many
    come near the kernel.
    """
    areas = mesh.vertex_areas_mm2()
    mass = np.maximum(areas, _MIN_AREA_SHARE * max(float(areas.mean()), 1e-300))
    step = radius_mm**2 / 4.0 / steps
    solver = splu((diags(mass) - step * curvature.cotangent_laplacian(mesh)).tocsc())
    # One column at a time: several at once are solved by a threaded product, whose last bits depend on the
    # threads.
    columns = []
    for column in np.asarray(values, dtype=np.float64).T:
        for _ in range(steps):
            column = solver.solve(mass * column)
        columns.append(column)
    return np.stack(columns, axis=1)
