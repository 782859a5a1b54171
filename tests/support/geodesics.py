"""Meshes on which geodesics are hard, and the slow route to all of them."""

import numpy as np

from pipeline.core.mesh import FloatArray, Mesh
from pipeline.kernels.geodesics import GeodesicSolver
from tests.support import shapes


def solver_of(mesh: Mesh, threads: int | None = None) -> GeodesicSolver:
    return GeodesicSolver(mesh.vertices, mesh.faces, threads=threads)


def canonical_matrix(solver: GeodesicSolver) -> FloatArray:
    """The slow route: all pairs, the smaller of both directions."""
    rows = solver.distances(np.arange(solver.n))
    return np.asarray(np.minimum(rows, rows.T))


def rough_blob() -> Mesh:
    """A blob with saddles everywhere: every second vertex moved in or out."""
    blob = shapes.bumpy_blob(3)
    rng = np.random.default_rng(4)
    return Mesh(blob.vertices * (1 + 0.06 * rng.normal(size=(len(blob.vertices), 1))), blob.faces)


def two_pieces() -> Mesh:
    one, other = shapes.icosphere(3.0, 2), shapes.icosphere(2.0, 1)
    return Mesh(
        np.concatenate([one.vertices, other.vertices + np.array([20.0, 0, 0])]),
        np.concatenate([one.faces, other.faces + len(one.vertices)]),
    )


def torn(mesh: Mesh, seed: int, share: float = 0.15) -> Mesh:
    """The mesh with random triangles missing: borders, islands, bow ties."""
    kept = np.random.default_rng(seed).random(len(mesh.faces)) > share
    return Mesh(mesh.vertices, mesh.faces[kept])
