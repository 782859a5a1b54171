"""Covariance of a weighted least-squares fit whose residuals are correlated within groups.

Delete-a-group jackknife: the fit is repeated without each group of rows in turn, and the scatter of these
fits is the covariance of the whole one. Residuals may be correlated in any way within a group; groups count
as independent. It is the estimator CR3 of the literature on clustered data (MacKinnon, Nielsen & Webb,
"Cluster-robust inference: a guide to empirical practice", 2023), which errs to the safe side with few groups.
"""

import numpy as np

from pipeline.core.mesh import FloatArray, IndexArray

#: Groups that must be there for every unknown, at least. Chosen by hand: with fewer, the fits without a group
#: are of other data rather than of nearly the same.
MIN_GROUPS_AN_UNKNOWN = 2
#: Added to the diagonal of the normal equations, over their smallest eigenvalue: where one group alone holds
#: an unknown, the fit without it has a large, not an undefined value of it. Chosen by hand.
RIDGE_SHARE = 1e-3


def covariance(
    rows: FloatArray, residual: FloatArray, weights: FloatArray, group: IndexArray
) -> FloatArray | None:
    """(p, p) covariance of the unknowns x that minimise the weighted square sum of `residual - rows x`.

    rows : (k, p); residual : (k,); weights : (k,) >= 0; group : (k,) in [0, g), any of them empty.
    None where the groups are too few, or the rows leave an unknown free.
    """
    p = rows.shape[1]
    kept = weights > 0
    rows, residual, w = rows[kept], residual[kept], weights[kept] / max(float(weights.sum()), 1e-300)
    number = np.unique(group[kept], return_inverse=True)[1]
    count = int(number.max()) + 1 if number.size else 0
    if count < MIN_GROUPS_AN_UNKNOWN * p:
        return None
    A, b = np.empty((count, p, p)), np.empty((count, p))
    for i in range(p):
        b[:, i] = np.bincount(number, weights=w * rows[:, i] * residual, minlength=count)
        for j in range(i, p):
            A[:, i, j] = np.bincount(number, weights=w * rows[:, i] * rows[:, j], minlength=count)
            A[:, j, i] = A[:, i, j]
    whole = A.sum(axis=0)
    without = whole - A
    least = float(np.linalg.eigvalsh(whole)[0])
    if least <= 0:
        return None
    fits = np.linalg.solve(without + RIDGE_SHARE * least * np.eye(p), (b.sum(axis=0) - b)[:, :, None])[
        :, :, 0
    ]
    apart = fits - fits.mean(axis=0)
    return np.asarray((count - 1) / count * np.einsum("gi,gj->ij", apart, apart))
