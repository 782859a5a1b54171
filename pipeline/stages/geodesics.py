"""Distances on the working mesh, and the cut-off distance d_c they imply."""

from dataclasses import dataclass

import numpy as np

from pipeline.kernels.geodesics import EXACT, GeodesicSolver
from pipeline.mesh import Mesh
from pipeline.outcome import Note


@dataclass(frozen=True, slots=True)
class Geodesics:
    """solver : of the working mesh; d_c_mm : the quantile of all pairwise distances, finite and > 0"""

    solver: GeodesicSolver
    d_c_mm: float
    warnings: tuple[Note, ...]


def geodesics(mesh: Mesh, name: str, quantile: float) -> Geodesics:
    """Build the solver; when more than the quantile's share of pairs lies across pieces, d_c is the largest
    finite distance instead of infinity, and a warning says so.
    """
    solver = GeodesicSolver(mesh.vertices, mesh.faces)
    warnings = []
    if not EXACT:
        detail = f"{name}: distances follow mesh edges (Dijkstra), some 5 to 10 % longer than the exact geodesics"
        warnings.append(Note(code="geodesics_edge_path", detail=detail))
    d_c = solver.quantile(quantile)
    if not np.isfinite(d_c):
        firsts = np.unique(solver.components, return_index=True)[1]
        rows = [solver.distances(int(first)) for first in firsts]
        d_c = max(float(row[np.isfinite(row)].max()) for row in rows)
        warnings.append(
            Note(
                code="many_components",
                detail=f"{name}: {len(firsts)} pieces; d_c is the largest finite distance",
            )
        )
    return Geodesics(solver, d_c, tuple(warnings))
