"""Where on a surface a value stands out: smoothed over neighbours, and the connected patch of the largest
area beyond a limit.
"""

from dataclasses import dataclass

import numpy as np
from scipy.sparse import coo_matrix, csgraph, csr_matrix

from pipeline.core.mesh import BoolArray, FloatArray, Mesh
from pipeline.kernels import topology


@dataclass(frozen=True, slots=True)
class Patch:
    """centre_mm : (3,) the place of the largest absolute value, in the frame of the mesh; area_mm2 : of the
    patch; mean : area-weighted mean value; peak : the value at the centre
    """

    centre_mm: FloatArray
    area_mm2: float
    mean: float
    peak: float


def neighbour_means(
    adjacency: csr_matrix, values: FloatArray, weights: FloatArray, rounds: int
) -> FloatArray:
    """(n,) weighted mean of each place and its neighbours, `rounds` times. adjacency : (n, n), with itself;
    values, weights : (n,); a place whose neighbourhood has no weight gets 0
    """
    spread = adjacency
    for _ in range(rounds):
        total = spread @ weights
        values = np.divide(spread @ (weights * values), total, out=np.zeros_like(total), where=total > 0)
        weights = np.where(weights > 0, weights, total * 1e-6)  # what was empty counts little
    return np.asarray(values, dtype=np.float64)


def largest_patch(
    points: FloatArray, adjacency: csr_matrix, areas_mm2: FloatArray, values: FloatArray, beyond: BoolArray
) -> Patch | None:
    """The connected patch of the places in `beyond` (n,) with the largest area; None without any.

    points : (n, 3) mm; adjacency : (n, n); areas_mm2 : (n,) that count for each place
    """
    if not beyond.any():
        return None
    chosen = np.flatnonzero(beyond)
    patch = csgraph.connected_components(adjacency[chosen][:, chosen], directed=False)[1]
    of_patch = np.bincount(patch, weights=areas_mm2[chosen])
    members = chosen[patch == int(of_patch.argmax())]
    weights = areas_mm2[members]
    peak = members[int(np.abs(values[members]).argmax())]
    mean = float((weights * values[members]).sum() / max(float(weights.sum()), 1e-300))
    return Patch(points[peak], float(of_patch.max()), mean, float(values[peak]))


def border_length_mm(vertices: FloatArray, edges: topology.Edges) -> float:
    """Total length of the edges with one triangle."""
    ends = vertices[edges.ends[edges.count == 1]]
    return float(np.linalg.norm(ends[:, 0] - ends[:, 1], axis=1).sum())


def without_low_order(points: FloatArray, values: FloatArray, weights: FloatArray) -> FloatArray:
    """(n,) `values` minus their weighted least-squares polynomial of second degree in x, y, z.

    points : (n, 3); weights : (n,) >= 0. A camera's distortion and a warp of the print are of low order; a
    difference of shape is not.
    """
    centre = np.average(points, axis=0, weights=weights)
    x, y, z = ((points - centre) / max(float(np.ptp(points, axis=0).max()), 1e-300)).T
    terms = np.stack([np.ones_like(x), x, y, z, x * x, y * y, z * z, x * y, y * z, z * x], axis=1)
    weighted = terms * weights[:, None]
    normal = np.einsum("ni,nj->ij", weighted, terms)
    normal += 1e-9 * np.trace(normal) * np.eye(terms.shape[1])
    coefficients = np.linalg.solve(normal, np.einsum("ni,n->i", weighted, values))
    return np.asarray(values - np.einsum("ni,i->n", terms, coefficients))


def adjacency_of(mesh: Mesh) -> csr_matrix:
    """(n, n) 1 where two vertices of a mesh share an edge, and on the diagonal."""
    n = len(mesh.vertices)
    ends = topology.edges(mesh.faces).ends
    rows = np.concatenate([ends[:, 0], ends[:, 1], np.arange(n)])
    columns = np.concatenate([ends[:, 1], ends[:, 0], np.arange(n)])
    return coo_matrix((np.ones(len(rows)), (rows, columns)), shape=(n, n)).tocsr()
