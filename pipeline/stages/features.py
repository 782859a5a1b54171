"""The six features of a vertex, [a, m, G, l1, l2, l3]: area, mean and Gaussian curvature, Laplacian vector."""

from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from pipeline.kernels import curvature, topology
from pipeline.kernels.geodesics import GeodesicSolver
from pipeline.mesh import FloatArray, Mesh
from pipeline.settings import FeaturesSettings

NAMES = ("a", "m", "G", "l1", "l2", "l3")


@dataclass(frozen=True, slots=True)
class Features:
    """On the working mesh.

    values : (n, 6) columns as `NAMES`; radius_mm : physical scale of the features;
    border_distance_mm : (n,) along the surface to the nearest open border, inf without one;
    mean_curvature_per_mm : (n,) pointwise, averaged over the radius, + convex
    """

    values: FloatArray
    radius_mm: float
    border_distance_mm: FloatArray
    mean_curvature_per_mm: FloatArray


def features_radius_mm(design_area_mm2: float, settings: FeaturesSettings) -> float:
    """The physical scale, resolved once a job from the design and used for both meshes."""
    return settings.radius_mm or settings.radius_share * float(np.sqrt(design_area_mm2))


def features(mesh: Mesh, solver: GeodesicSolver, radius_mm: float, settings: FeaturesSettings) -> Features:
    """`integrated` (paper): PyMesh's values in file units, area = lumped area, Laplacian = half cotangent sums,
    m = half its length, G = angle defect without border correction.

    `physical` (default): pointwise values averaged over a geodesic disc of `radius_mm`, so that the triangulation
    drops out; a = surface area inside a ball of that radius over pi radius^2 (1 on a plane). Border vertices have
    no curvature of their own and do not enter the averages.
    """
    areas = mesh.vertex_areas_mm2()
    laplacian = curvature.integrated_laplacian(mesh)
    convexity = -0.5 * np.einsum("nd,nd->n", laplacian, mesh.vertex_normals())
    gaussian = curvature.angle_defect(mesh, border_correction=True)

    inner = ~topology.border_vertices(mesh.faces, len(areas))
    averaging = curvature.averaging(mesh, solver.within(radius_mm), radius_mm)
    pointwise = np.column_stack([convexity, gaussian, laplacian]) * (inner / areas)[:, None]
    share_inner = np.maximum(averaging @ inner.astype(np.float64), 1e-12)
    averaged = np.asarray(averaging @ pointwise, dtype=np.float64) / share_inner[:, None]

    if settings.kind == "integrated":
        defect = curvature.angle_defect(mesh, border_correction=False)
        values = np.column_stack([areas, 0.5 * np.linalg.norm(laplacian, axis=1), defect, laplacian])
    else:
        values = np.column_stack([_ball_area(mesh, areas, radius_mm), averaged])
    return Features(values, radius_mm, _border_distance(mesh, solver), averaged[:, 0])


def _ball_area(mesh: Mesh, areas: FloatArray, radius_mm: float) -> FloatArray:
    """(n,) surface area inside the ball of `radius_mm` over that of a flat disc."""
    tree = cKDTree(mesh.vertices)
    near = tree.sparse_distance_matrix(tree, radius_mm, output_type="coo_matrix")
    # A smooth edge (weight 1 inside, 0 at the radius) keeps single triangles from flipping the value.
    weight = np.clip(2.0 * (1.0 - near.data / radius_mm), 0.0, 1.0)
    inside = np.bincount(near.row, weights=weight * areas[near.col], minlength=len(areas))
    # integral of the weight over a flat disc of radius r: pi r^2 (1/4 + 1/3) = 7/12 pi r^2
    return inside / (7.0 / 12.0 * np.pi * radius_mm**2)


def _border_distance(mesh: Mesh, solver: GeodesicSolver) -> FloatArray:
    return solver.distances_from_set(np.flatnonzero(topology.border_vertices(mesh.faces, len(mesh.vertices))))
