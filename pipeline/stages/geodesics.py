"""Geodesic distances on the working mesh, the cut-off distance d_c, and the local density within d_c."""

from dataclasses import dataclass

import numpy as np

from pipeline.core.mesh import FloatArray, Mesh
from pipeline.core.results import Note
from pipeline.core.settings import GeodesicsSettings, SegmentationSettings
from pipeline.kernels import crease
from pipeline.kernels.geodesics import GeodesicSolver


@dataclass(frozen=True, slots=True)
class Geodesics:
    """Geodesics of a mesh with n vertices.

    solver : in the metric of the settings; surface : in the surface metric (the same object if the settings
    select that metric); weights : (n,) weight of each vertex in a density; d_c_mm : quantile of all pairwise
    distances, finite and > 0; rho : (n,) cut-off density (Rodriguez & Laio 2014, eq. 1)
    """

    solver: GeodesicSolver
    surface: GeodesicSolver
    weights: FloatArray
    d_c_mm: float
    rho: FloatArray
    warnings: tuple[Note, ...]


def geodesics(
    mesh: Mesh, name: str, size_mm: float, metric: GeodesicsSettings, density: SegmentationSettings
) -> Geodesics:
    """Distances in the metric of the settings, d_c, and rho by the cut-off kernel.

    size_mm : sqrt(area) of the design, the unit of the shares in the settings. If so many pairs lie on
    different components that the quantile is infinite, d_c is the largest finite distance, with the warning
    `many_components`.
    """
    surface = solver = GeodesicSolver(mesh.vertices, mesh.faces)
    if metric.metric == "crease":
        phi = crease.concavity(mesh, metric.crease_radius_share * size_mm)
        lifted = crease.lifted_lengths(mesh.vertices, mesh.faces, phi, metric.crease_beta)
        solver = GeodesicSolver(mesh.vertices, mesh.faces, lengths=lifted)
    weights = vertex_weights(mesh, size_mm, density)
    d_c, rho = solver.cutoff_density(density.quantile, weights)
    if np.isfinite(d_c):
        return Geodesics(solver, surface, weights, d_c, rho, ())
    firsts = np.unique(solver.components, return_index=True)[1]
    rows = solver.distances(firsts)
    detail = f"{name}: the mesh has {len(firsts)} connected components; d_c is the largest finite distance"
    d_c = float(rows[np.isfinite(rows)].max())
    return Geodesics(solver, surface, weights, d_c, rho, (Note(code="many_components", detail=detail),))


def vertex_weights(mesh: Mesh, size_mm: float, settings: SegmentationSettings) -> FloatArray:
    """(n,) weight in rho: 1 (paper), the vertex area (mm^2), or the area weighted by convexity (mm^2)."""
    if settings.density == "vertex":
        return np.ones(len(mesh.vertices))
    if settings.density == "area":
        return mesh.vertex_areas_mm2()
    return crease.convexity_weights(
        mesh, settings.convexity_radius_share * size_mm, settings.convexity_sharpness
    )
