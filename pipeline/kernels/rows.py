"""Groups of equal rows, in order of first occurrence; much faster than `np.unique(axis=0)`."""

from typing import Any

import numpy as np
import numpy.typing as npt

from pipeline.core.mesh import IndexArray


def group_rows(rows: npt.NDArray[Any]) -> tuple[IndexArray, IndexArray]:
    """Index (g,) of the first occurrence of each distinct row, ascending, and the group (n,) of every row.

    rows : (n, c). `first, group = group_rows(rows)` gives `rows[first][group] == rows`.
    """
    if len(rows) == 0:
        return np.zeros(0, dtype=np.int64), np.zeros(0, dtype=np.int64)
    order = np.lexsort(rows.T)
    is_new = np.concatenate([[True], (np.diff(rows[order], axis=0) != 0).any(axis=1)])
    sorted_group = np.zeros(len(rows), dtype=np.int64)
    sorted_group[order] = np.cumsum(is_new) - 1
    # lexsort is stable, so the first of a group in sorted order is its first occurrence.
    first_of_group = order[is_new]
    by_occurrence = np.argsort(first_of_group)
    rank = np.zeros(len(first_of_group), dtype=np.int64)
    rank[by_occurrence] = np.arange(len(first_of_group))
    return first_of_group[by_occurrence], rank[sorted_group]
