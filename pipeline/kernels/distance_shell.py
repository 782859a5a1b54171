"""Pairs of vertices in a narrow shell of geodesic distances, and the sums over the pairs inside the shell.

The distances found from the two ends of a pair differ in the last bits. The canonical distance is the smaller
of the two, and whether a pair lies below a limit is decided by the canonical distance.
"""

from dataclasses import dataclass

import numpy as np

from pipeline.core.mesh import FloatArray, IndexArray


@dataclass(frozen=True, slots=True)
class DistanceShell:
    """Pairs up to a shell of distances.

    counts, sums : (n,) number and summed weights of the vertices nearer than the shell; first, second, d,
    times : (k,) the pairs in the shell, each once, with the canonical distance in mm and the number of ends
    (1 or 2) from which they were found in it
    """

    counts: IndexArray
    sums: FloatArray
    first: IndexArray
    second: IndexArray
    d: FloatArray
    times: IndexArray

    def up_to(self, limit: float, weights: FloatArray, scale: float = 0.0) -> tuple[IndexArray, FloatArray]:
        """(n,) number and (n,) summed weights of the vertices with d < limit (mm).

        scale : mm; if > 0, the weights are multiplied by exp(-(d / scale)^2)
        """
        counts, sums, inside = self.counts.copy(), self.sums.copy(), self.d < limit
        first, second, d = self.first[inside], self.second[inside], self.d[inside]
        kernel = np.exp(-((d / scale) ** 2)) if scale > 0 else np.ones(len(d))
        for here, there in ((first, second), (second, first)):
            np.add.at(counts, here, 1)
            np.add.at(sums, here, weights[there] * kernel)
        return counts, sums


def canonical_pairs(
    i: IndexArray, j: IndexArray, d: FloatArray, n: int
) -> tuple[IndexArray, IndexArray, FloatArray, IndexArray]:
    """Merge directed pairs: smaller index, larger index, smaller distance, number of directions (1 or 2)."""
    keys = np.minimum(i, j) * n + np.maximum(i, j)
    order = np.lexsort((d, keys))
    unique, first, times = np.unique(keys[order], return_index=True, return_counts=True)
    return unique // n, unique % n, d[order[first]], times
