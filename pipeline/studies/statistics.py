"""Distributions over trials, for both studies."""

from collections.abc import Sequence

import numpy as np

from pipeline.core.mesh import FloatArray
from pipeline.core.results import Quantiles

LEVELS = (0.05, 0.25, 0.5, 0.75, 0.95)


def quantiles(values: Sequence[float] | FloatArray) -> Quantiles:
    """Quantiles of the finite `values`; null if there are none."""
    finite = np.asarray(values, dtype=np.float64)
    finite = finite[np.isfinite(finite)]
    found = np.quantile(finite, LEVELS).tolist() if finite.size else [None] * len(LEVELS)
    return Quantiles(n=int(finite.size), **dict(zip(("p05", "p25", "p50", "p75", "p95"), found, strict=True)))
