"""Polygons of the text formats OBJ and OFF as triangles, with the checks that both need."""

import numpy as np

from pipeline.core.errors import CoordinateOutOfRange, MeshTooLarge, NotFinite
from pipeline.core.mesh import FloatArray, IndexArray
from pipeline.core.settings import LoadSettings
from pipeline.stages.load.polygons import triangulated

#: Beyond it the area of a polygon overflows. Derived: the fourth root of the max of float64, rounded down.
MAX_OF_POLYGON = 1e75


def check_size(n_vertices: int, counts: IndexArray, settings: LoadSettings) -> None:
    """Raise MeshTooLarge where polygons with `counts` corners give more triangles than allowed."""
    triangles = int(np.maximum(counts - 2, 0).sum())
    if not settings.allows(n_vertices, triangles):
        raise MeshTooLarge(
            f"{triangles} triangles and {n_vertices} vertices; the limits are "
            f"{settings.max_faces} and {settings.max_points}"
        )


def triangles_of(vertices: FloatArray, corners: IndexArray, counts: IndexArray) -> IndexArray:
    """(m, 3) triangles of polygons, whose `corners` all exist; see `polygons.triangulated`.

    Raises
    ------
    CoordinateOutOfRange
        When the corners of a polygon are too far for its area to be computed.
    """
    if not (counts == 3).all() and len(vertices):
        reach = np.abs(vertices[corners]).max(initial=0.0)
        if reach > MAX_OF_POLYGON:
            raise CoordinateOutOfRange(f"a corner of a face lies at {reach:.3g}")
    return triangulated(vertices, corners, counts)


def check_finite(vertices: FloatArray, used: IndexArray, lines: IndexArray | None, kind: str) -> None:
    """Raise NotFinite, with a line or index, for a vertex among `used` that is NaN or infinite."""
    bad = used[~np.isfinite(vertices[used]).all(axis=1)]
    if bad.size:
        place = f"has index {bad[0]}" if lines is None else f"is on line {lines[bad[0]]}"
        raise NotFinite(
            f"{bad.size} of {len(vertices)} vertices of the {kind} are NaN or infinite; the first {place}"
        )
