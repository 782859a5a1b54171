"""Polygons as triangles: a fan where all corners turn the same way, ears cut off (earcut) where not."""

import mapbox_earcut
import numpy as np

from pipeline.core.errors import IndexOutOfRange
from pipeline.core.mesh import BoolArray, FloatArray, IndexArray

#: A corner that turns back by less than this share of the polygon's area is straight. Chosen by hand:
#: rounding of single precision.
STRAIGHT_SHARE = 1e-6


def triangulated(vertices: FloatArray, corners: IndexArray, counts: IndexArray) -> IndexArray:
    """(m, 3) triangles of polygons, in their order and orientation.

    vertices : (n, 3); corners : (sum of counts,) vertex of each corner, polygon after polygon; counts : (p,)
    corners of each; a polygon with less than three has no triangles

    Raises
    ------
    IndexOutOfRange
        When a polygon refers to a vertex that does not exist.
    """
    corners, counts = np.asarray(corners, dtype=np.int64), np.asarray(counts, dtype=np.int64)
    outside = np.flatnonzero((corners < 0) | (corners >= len(vertices)))
    if outside.size:
        polygon = int(np.searchsorted(np.cumsum(counts), outside[0], side="right"))
        raise IndexOutOfRange(
            f"face {polygon} (the first is 0) refers to vertex {corners[outside[0]]}, but there are "
            f"{len(vertices)}, counted from 0"
        )
    starts = np.cumsum(counts) - counts
    faces, owners = [np.zeros((0, 3), dtype=np.int64)], [np.zeros(0, dtype=np.int64)]
    for count in np.unique(counts[counts >= 3]):
        of_count = np.flatnonzero(counts == count)
        loops = corners[starts[of_count, None] + np.arange(count)]
        convex = np.ones(len(loops), dtype=np.bool_) if count == 3 else _is_convex(vertices[loops])
        step = np.arange(count - 2)
        fan = np.stack([np.zeros_like(step), step + 1, step + 2], axis=1)
        faces.append(loops[convex][:, fan].reshape(-1, 3))
        owners.append(np.repeat(of_count[convex], count - 2))
        for loop, owner in zip(loops[~convex], of_count[~convex], strict=True):
            ears = loop[_ears(vertices[loop])]
            faces.append(ears)
            owners.append(np.full(len(ears), owner))
    order = np.argsort(np.concatenate(owners), kind="stable")
    return np.concatenate(faces)[order]


def _is_convex(polygons: FloatArray) -> BoolArray:
    """(p,) whether no corner of the polygon (p, k, 3) turns back, seen along its normal."""
    ahead = np.roll(polygons, -1, axis=1) - polygons
    turns = np.cross(ahead, np.roll(ahead, -1, axis=1))
    normal = _normals(polygons)
    area = np.linalg.norm(normal, axis=1)
    unit = np.divide(normal, area[:, None], out=np.zeros_like(normal), where=area[:, None] > 0)
    along = np.einsum("pkd,pd->pk", turns, unit)
    # a star turns one way all along, but more than once
    onward = np.einsum("pkd,pkd->pk", ahead, np.roll(ahead, -1, axis=1))
    once = np.arctan2(along, onward).sum(axis=1) < 3.0 * np.pi
    return np.asarray((along >= -STRAIGHT_SHARE * area[:, None]).all(axis=1) & once)


def _normals(polygons: FloatArray) -> FloatArray:
    """(p, 3) twice the area vector of each polygon (p, k, 3), by Newell's method."""
    centred = polygons - polygons[:, :1]
    return np.asarray(np.cross(centred, np.roll(centred, -1, axis=1)).sum(axis=1))


def _ears(polygon: FloatArray) -> IndexArray:
    """(k - 2, 3) triangles of one polygon (k, 3), which may be concave, seen along its largest extent."""
    normal = _normals(polygon[None])[0]
    axis = int(np.abs(normal).argmax())
    plane = np.ascontiguousarray(np.delete(polygon - polygon[0], axis, axis=1))
    triangles = np.asarray(
        mapbox_earcut.triangulate_float64(plane, np.array([len(polygon)], dtype=np.uint32)), dtype=np.int64
    ).reshape(-1, 3)
    a, b, c = (polygon[triangles[:, k]] for k in range(3))
    turned = np.cross(b - a, c - a) @ normal < 0
    triangles[turned] = triangles[turned][:, ::-1]
    return triangles
