"""Six features of a vertex, [a, m, G, l1, l2, l3]: area, mean and Gaussian curvature, Laplacian vector."""

from dataclasses import dataclass

import numpy as np

from pipeline.core.mesh import FloatArray, Mesh
from pipeline.core.settings import FeaturesSettings
from pipeline.kernels import curvature, topology
from pipeline.kernels.diffusion import diffused
from pipeline.kernels.geodesics import GeodesicSolver
from pipeline.stages.resample import working_edge_mm

NAMES = ("a", "m", "G", "l1", "l2", "l3")
#: Implicit steps of the diffusion: with 2 the kernel has a sharp peak, which keeps the noise of single
#: triangles. Chosen by hand, not fitted.
STEPS = 6
#: Smallest averaged share of vertices that have a curvature, no unit; avoids a division by 0.
_MIN_INNER_SHARE = 1e-9
#: Smallest length of an averaged normal, no unit; limits the feature a to its inverse. Chosen by hand, not
#: fitted.
_MIN_PROJECTED = 1e-6


@dataclass(frozen=True, slots=True)
class Features:
    """Features of the vertices of `mesh`, which is finer than the working mesh (the same without resampling).

    values : (n, 6) columns as `NAMES`; radius_mm : physical scale of the features; border_distance_mm : (n,)
    geodesic distance to the nearest open border, inf without one; mean_curvature_per_mm,
    gaussian_curvature_per_mm2 : (n,) pointwise values averaged over the radius, mean curvature positive where
    convex
    """

    mesh: Mesh
    values: FloatArray
    radius_mm: float
    border_distance_mm: FloatArray
    mean_curvature_per_mm: FloatArray
    gaussian_curvature_per_mm2: FloatArray


def features_radius_mm(design_area_mm2: float, settings: FeaturesSettings) -> float:
    """The physical scale, mm: determined once per job from the design and used for both meshes."""
    return settings.radius_mm or settings.radius_share * float(np.sqrt(design_area_mm2))


def features_edge_mm(design_area_mm2: float, settings: FeaturesSettings) -> float:
    """Edge length, mm, of the mesh on which the features are computed."""
    return working_edge_mm(design_area_mm2, settings.target_vertices)


def features(mesh: Mesh, radius_mm: float, settings: FeaturesSettings) -> Features:
    """Compute the features of every vertex, of the kind that `settings.kind` selects.

    `integrated` (paper): the values of PyMesh in file units; a = lumped area, l = half cotangent sums, m =
    half the length of l, G = angle defect without border correction.

    `physical` (default): pointwise values averaged along the surface with the weights exp(-2 (d / radius)^2),
    which removes the dependence on the triangulation; a = area over projected area within this radius (1 on a
    plane), from the averaged normal. Border vertices have no curvature and are excluded from the averages.
    """
    n = len(mesh.vertices)
    areas = mesh.vertex_areas_mm2()
    laplacian, normals = curvature.integrated_laplacian(mesh), mesh.vertex_normals()
    gaussian = curvature.angle_defect(mesh, border_correction=True)
    on_border = topology.border_vertices(mesh.faces, n)
    inner = (~on_border & (areas > 0)).astype(np.float64)
    integrated = np.column_stack([-0.5 * np.einsum("nd,nd->n", laplacian, normals), gaussian, laplacian])
    pointwise = np.divide(integrated, areas[:, None], out=np.zeros_like(integrated), where=inner[:, None] > 0)

    # exp(-2 (d / radius)^2) is exp(-(d / r)^2) at r = radius / sqrt 2
    smooth = diffused(mesh, np.column_stack([inner, pointwise, normals]), radius_mm / np.sqrt(2), STEPS)
    averaged = smooth[:, 1:6] / np.maximum(smooth[:, :1], _MIN_INNER_SHARE)
    if settings.kind == "integrated":
        defect = curvature.angle_defect(mesh, border_correction=False)
        values = np.column_stack([areas, 0.5 * np.linalg.norm(laplacian, axis=1), defect, laplacian])
    else:
        projected = np.linalg.norm(smooth[:, 6:9], axis=1)
        values = np.column_stack([1.0 / np.maximum(projected, _MIN_PROJECTED), averaged])
    return Features(
        mesh, values, radius_mm, _border_distance(mesh, np.flatnonzero(on_border)), *averaged[:, :2].T
    )


def _border_distance(mesh: Mesh, border: np.ndarray) -> FloatArray:
    if len(border) == 0:
        return np.full(len(mesh.vertices), np.inf)
    return GeodesicSolver(mesh.vertices, mesh.faces).distances_from_set(border)
