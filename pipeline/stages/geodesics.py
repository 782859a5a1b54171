"""Distances on the working mesh, the cut-off distance d_c they imply, and what lies within d_c of each vertex."""

from dataclasses import dataclass

import numpy as np

from pipeline.kernels.geodesics import GeodesicSolver
from pipeline.mesh import FloatArray, Mesh
from pipeline.outcome import Note
from pipeline.settings import SegmentationSettings


@dataclass(frozen=True, slots=True)
class Geodesics:
    """solver : of the working mesh; weights : (n,) what each vertex counts for in a density; d_c_mm : the quantile of all
    pairwise distances, finite and > 0; rho : (n,) cut-off density (eq. 1), from the same pass over the geodesic discs
    """

    solver: GeodesicSolver
    weights: FloatArray
    d_c_mm: float
    rho: FloatArray
    warnings: tuple[Note, ...]


def geodesics(mesh: Mesh, name: str, settings: SegmentationSettings) -> Geodesics:
    """When more than the quantile's share of pairs lies across pieces, d_c is the largest finite distance instead
    of infinity, and a warning says so.
    """
    solver = GeodesicSolver(mesh.vertices, mesh.faces)
    weights = mesh.vertex_areas_mm2() if settings.density == "area" else np.ones(len(mesh.vertices))
    d_c, rho = solver.cutoff_density(settings.quantile, weights)
    if np.isfinite(d_c):
        return Geodesics(solver, weights, d_c, rho, ())
    firsts = np.unique(solver.components, return_index=True)[1]
    rows = solver.distances(firsts)
    detail = f"{name}: {len(firsts)} pieces; d_c is the largest finite distance"
    d_c = float(rows[np.isfinite(rows)].max())
    return Geodesics(solver, weights, d_c, rho, (Note(code="many_components", detail=detail),))
