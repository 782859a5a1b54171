"""One side of a part that the first search misses is found by the second; another part still is not."""

from pathlib import Path

import numpy as np
import pytest

import pipeline
from pipeline import Settings
from pipeline.core.mesh import FloatArray, Mesh
from pipeline.kernels import rigid
from tests.support import shapes
from tests.support.registering import register
from tests.support.scans import save

#: So few hypotheses that the first search has no right one.
POOR = Settings.model_validate(
    {
        "resample": {"target_vertices": 2000},
        "features": {"target_vertices": 3000},
        "matching": {"max_hypotheses": 1, "candidates": 1, "max_pairs": 100, "axes_poses": False},
    }
)


def _seen_from(direction: FloatArray, part: Mesh, least_share: float) -> Mesh:
    """The faces of a part that face `direction`, of which the nearest hold `least_share` of the area."""
    corners = part.vertices[part.faces].mean(axis=1)
    nearest = np.argsort(-(corners @ direction), kind="stable")
    area = np.cumsum(part.face_areas_mm2()[nearest])
    kept = part.faces[np.sort(nearest[: int(np.searchsorted(area, least_share * area[-1]))])]
    used, numbers = np.unique(kept, return_inverse=True)
    return Mesh(part.vertices[used], numbers.reshape(-1, 3))
