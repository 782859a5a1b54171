"""Gaussian process landmarks: the next landmark is the point where a Gaussian process, conditioned on the
landmarks so far, has the largest variance.

Gao, Kovalsky, Daubechies, "Gaussian process landmarking on manifolds" (2019) and, with Boyer, "Gaussian
process landmarking for three-dimensional geometric morphometrics" (2019).

    k(x, y) = sum_z phi(x, z) w(z) phi(z, y),   phi(x, y) = exp(-|x - y|^2 / t)
    w = area (lambda |K| / sum |K| + (1 - lambda) |H| / sum |H|),   lambda = 1/2, exponent rho = 1
    var(x) = k(x, x) - k(x, taken) k(taken, taken)^-1 k(taken, x)

As in the authors' code (shaharkov/GPLmkBDMatch), distances are Euclidean, phi keeps the 500 nearest vertices
and is symmetrised, and t is a fifth of the mean edge length of the mesh scaled to area 1, which is
edge sqrt(area) / 5 here. In addition, values of phi below 1e-6 are dropped. Because w >= 0, k remains
positive semidefinite. The variances are those of a pivoted Cholesky decomposition, so k is never formed: only
its diagonal and the columns of the landmarks are computed, O(n k^2) in all.
"""

from dataclasses import dataclass

import numpy as np
from scipy.sparse import csr_matrix
from scipy.spatial import cKDTree

from pipeline.core.mesh import FloatArray, IndexArray

#: Share of the Gaussian curvature in the weights, no unit; from literature (Gao et al. 2019).
LAMBDA = 0.5
#: Bandwidth t, in mean edge lengths on the mesh scaled to area 1; from the authors' code.
BANDWIDTH_EDGES = 0.2
#: Nearest vertices that phi keeps; from the authors' code.
NEAREST = 500
#: Smallest value of phi that is kept, no unit. Chosen by hand, not fitted.
_MIN_PHI = 1e-6
#: Smallest variance of a further landmark, as a share of the largest prior variance; below it only rounding
#: error remains. Chosen by hand, not fitted.
_MIN_VARIANCE_SHARE = 1e-12


@dataclass(frozen=True, slots=True)
class Greedy:
    """Result of the greedy selection.

    taken : (k,) indices in the order of selection; variance : (k,) variance of each before its selection, not
    increasing; left : (n,) remaining variance of every point at the end
    """

    taken: IndexArray
    variance: FloatArray
    left: FloatArray


def curvature_weights(areas: FloatArray, gaussian: FloatArray, mean: FloatArray) -> FloatArray:
    """(n,) weights w. areas : (n,) mm^2; gaussian : (n,) 1/mm^2; mean : (n,) 1/mm. On a flat surface w is the
    area over n.
    """
    total = np.zeros(len(areas))
    for share, curvature in ((LAMBDA, np.abs(gaussian)), (1 - LAMBDA, np.abs(mean))):
        size = float(curvature.sum())
        total += share * (curvature / size if size > 0 else 1.0 / len(areas))
    return areas * total


def heat_factor(points: FloatArray, bandwidth: float) -> csr_matrix:
    """(n, n) phi, no unit. points : (n, 3) mm; bandwidth : t, mm^2"""
    n, nearest = len(points), min(NEAREST + 1, len(points))
    reach = np.sqrt(bandwidth * np.log(1 / _MIN_PHI))
    neighbours = cKDTree(points).query(points, k=np.arange(1, nearest + 1), distance_upper_bound=reach)
    distance, other = np.asarray(neighbours[0]), np.asarray(neighbours[1])
    near = np.isfinite(distance)
    values = np.exp(-(distance[near] ** 2) / bandwidth)
    starts = np.concatenate([[0], np.cumsum(near.sum(axis=1))])
    phi = csr_matrix((values, other[near], starts), shape=(n, n))
    return csr_matrix((phi + phi.T) / 2)


def most_uncertain(phi: csr_matrix, weights: FloatArray, count: int) -> Greedy:
    """Select at most `count` points greedily by variance; fewer if only rounding error of variance remains.

    phi : (n, n), of `heat_factor`; weights : (n,), of `curvature_weights`
    """
    variance = np.asarray(phi.multiply(phi) @ weights, dtype=np.float64)
    floor = _MIN_VARIANCE_SHARE * float(variance.max(initial=0.0))
    # Rows of the Cholesky factor: k = factor.T @ factor on the selected points.
    factor = np.zeros((count, len(weights)))
    taken, before = [], []
    for row in range(count):
        new = int(variance.argmax()) if len(variance) else -1
        if new < 0 or variance[new] <= floor:
            break
        near = phi[[new]]
        column = phi[near.indices].T @ (weights[near.indices] * near.data)  # k(., new); phi is symmetric
        explained = np.einsum("kn,k->n", factor[:row], factor[:row, new])
        factor[row] = (column - explained) / np.sqrt(variance[new])
        taken.append(new)
        before.append(float(variance[new]))
        variance = np.maximum(variance - factor[row] ** 2, 0.0)
        variance[new] = 0.0
    return Greedy(np.array(taken, dtype=np.int64), np.array(before), variance)
