"""Gaussian process landmarks: the next point is where a Gaussian process, known at those taken, is most
uncertain.

Gao, Kovalsky, Daubechies, "Gaussian process landmarking on manifolds" (2019) and, with Boyer, "Gaussian
process landmarking for three-dimensional geometric morphometrics" (2019).

    k(x, y) = sum_z phi(x, z) w(z) phi(z, y),   phi(x, y) = exp(-|x - y|^2 / t)
    w = area (lambda |K| / sum |K| + (1 - lambda) |H| / sum |H|),   lambda = 1/2, curvatures to the power
    rho = 1 var(x) = k(x, x) - k(x, taken) k(taken, taken)^-1 k(taken, x)

As in the authors' code (shaharkov/GPLmkBDMatch) distances are straight ones, phi keeps the 500 nearest
vertices and is made symmetric, and t is a fifth of the mean edge length of the mesh scaled to area 1,
which is edge sqrt(area) / 5 here. Values of phi below 1e-6 are left out, too. As w >= 0, k stays positive
semidefinite whatever phi loses. The variances are those of a Cholesky decomposition with pivoting, so k is
never formed: only its diagonal and the columns taken, O(n k^2) in all.
"""

from dataclasses import dataclass

import numpy as np
from scipy.sparse import csr_matrix
from scipy.spatial import cKDTree

from pipeline.core.mesh import FloatArray, IndexArray

LAMBDA = 0.5
BANDWIDTH_EDGES = 0.2  # of a mean edge, at area 1
NEAREST = 500
_LEAST_PHI = 1e-6
_EXHAUSTED = 1e-12  # of the largest prior variance: beyond this only rounding is left


@dataclass(frozen=True, slots=True)
class Greedy:
    """taken : (k,) in order; variance : (k,) of each before it was taken, not rising; left : (n,) at the
    end
    """

    taken: IndexArray
    variance: FloatArray
    left: FloatArray


def curvature_weights(areas: FloatArray, gaussian: FloatArray, mean: FloatArray) -> FloatArray:
    """(n,) w of the vertices. areas : mm^2; gaussian, mean : curvatures; a flat surface weighs by area."""
    total = np.zeros(len(areas))
    for share, curvature in ((LAMBDA, np.abs(gaussian)), (1 - LAMBDA, np.abs(mean))):
        size = float(curvature.sum())
        total += share * (curvature / size if size > 0 else 1.0 / len(areas))
    return areas * total


def heat_factor(points: FloatArray, bandwidth: float) -> csr_matrix:
    """(n, n) phi. points : (n, 3) mm; bandwidth : t, mm^2."""
    n, nearest = len(points), min(NEAREST + 1, len(points))
    reach = np.sqrt(bandwidth * np.log(1 / _LEAST_PHI))
    found = cKDTree(points).query(points, k=np.arange(1, nearest + 1), distance_upper_bound=reach)
    distance, other = np.asarray(found[0]), np.asarray(found[1])
    near = np.isfinite(distance)
    values = np.exp(-(distance[near] ** 2) / bandwidth)
    starts = np.concatenate([[0], np.cumsum(near.sum(axis=1))])
    phi = csr_matrix((values, other[near], starts), shape=(n, n))
    return csr_matrix((phi + phi.T) / 2)


def most_uncertain(phi: csr_matrix, weights: FloatArray, count: int) -> Greedy:
    """At most `count` points of the greedy choice, fewer when no uncertainty is left. phi : (n, n);
    weights : (n,).
    """
    variance = np.asarray(phi.multiply(phi) @ weights, dtype=np.float64)
    floor = _EXHAUSTED * float(variance.max(initial=0.0))
    factor = np.zeros(
        (count, len(weights))
    )  # rows of the Cholesky factor: k = factor.T @ factor on the taken
    taken, before = [], []
    for row in range(count):
        new = int(variance.argmax()) if len(variance) else -1
        if new < 0 or variance[new] <= floor:
            break
        near = phi[[new]]
        column = phi[near.indices].T @ (weights[near.indices] * near.data)  # k(., new); phi is symmetric
        known = np.einsum("kn,k->n", factor[:row], factor[:row, new])
        factor[row] = (column - known) / np.sqrt(variance[new])
        taken.append(new)
        before.append(float(variance[new]))
        variance = np.maximum(variance - factor[row] ** 2, 0.0)
        variance[new] = 0.0
    return Greedy(np.array(taken, dtype=np.int64), np.array(before), variance)
