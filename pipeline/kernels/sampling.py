"""Deterministic samples of a surface and of a point set."""

from dataclasses import dataclass

import numpy as np

from pipeline.core.mesh import FloatArray, IndexArray, Mesh


@dataclass(frozen=True, slots=True)
class Samples:
    """Samples of equal area. points : (k, 3) mm; normals : (k, 3) unit; face : (k,) index of the triangle"""

    points: FloatArray
    normals: FloatArray
    face: IndexArray


def on_surface(mesh: Mesh, count: int, seed: int) -> Samples:
    """`count` samples by systematic sampling: equal steps of the cumulated area from a random start.

    The position inside a triangle is uniformly distributed. The same seed gives the same samples.
    """
    rng = np.random.default_rng(seed)
    areas = mesh.face_areas_mm2()
    steps = (np.arange(count) + rng.random()) / count * areas.sum()
    face = np.minimum(np.searchsorted(np.cumsum(areas), steps), len(areas) - 1)
    u, v = rng.random(count), rng.random(count)
    root = np.sqrt(u)
    weights = np.stack([1 - root, root * (1 - v), root * v], axis=1)
    points = np.einsum("kc,kcd->kd", weights, mesh.vertices[mesh.faces[face]])
    cross = mesh.face_cross_mm2()[face]
    return Samples(points, cross / np.linalg.norm(cross, axis=1, keepdims=True), face.astype(np.int64))


def farthest(points: FloatArray, count: int) -> IndexArray:
    """(k,) indices by Euclidean farthest-point sampling of `points` (n, 3); k = min(count, n).

    The first sample is the point farthest from the mean; each further one is farthest from all samples so
    far.
    """
    count = min(count, len(points))
    x, y, z = np.ascontiguousarray(points.T)

    def squared_from(at: FloatArray) -> FloatArray:
        # by columns: four times faster than rows of three
        return np.asarray((x - at[0]) ** 2 + (y - at[1]) ** 2 + (z - at[2]) ** 2)

    squared = squared_from(points.mean(axis=0))
    taken = np.zeros(count, dtype=np.int64)
    for number in range(count):
        taken[number] = int(squared.argmax())
        to_new = squared_from(points[taken[number]])
        squared = to_new if number == 0 else np.minimum(squared, to_new)
    return taken
