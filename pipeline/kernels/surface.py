"""Closest points on a triangle surface, and on which side of it a point lies.

Which triangle is closest is asked of open3d's ray-casting scene (embree, single precision); the closest point
on that triangle is then computed in double precision (`native/closest.cpp`), so a wrong neighbour can be taken only where two
triangles are equally far to about 1e-7 of the part's size. The sign follows Baerentzen & Aanaes, "Signed
distance computation using the angle weighted pseudonormal" (2005): right at edges and vertices too.
"""

import os
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import open3d as o3d

from pipeline.core.mesh import BoolArray, FloatArray, IndexArray, Mesh
from pipeline.kernels import topology
from pipeline.kernels.native import core


@dataclass(frozen=True, slots=True)
class Closest:
    """point : (k, 3) on the surface; face : (k,) int64; weights : (k, 3) barycentric, exactly 0 off the closest feature: two
    zeros at a vertex, one on an edge, none inside; distance : (k,) >= 0; normal : (k, 3) unit, of the face
    """

    point: FloatArray
    face: IndexArray
    weights: FloatArray
    distance: FloatArray
    normal: FloatArray


MANY_POINTS = 1_000  # from here on threads are worth their start


class Surface:
    """A triangle surface to ask for closest points; built once, asked often."""

    def __init__(self, mesh: Mesh) -> None:
        self.mesh = mesh
        # Single precision is relative to the origin, so the part is moved there first.
        self._centre = (mesh.vertices.min(axis=0) + mesh.vertices.max(axis=0)) / 2
        self._scene = o3d.t.geometry.RaycastingScene(nthreads=1)
        self._scene.add_triangles(
            o3d.core.Tensor((mesh.vertices - self._centre).astype(np.float32)),
            o3d.core.Tensor(mesh.faces.astype(np.uint32)),
        )

    @cached_property
    def _face_normals(self) -> FloatArray:
        cross = self.mesh.face_cross_mm2()
        length = np.linalg.norm(cross, axis=1, keepdims=True)
        unit: FloatArray = np.divide(cross, length, out=np.zeros_like(cross), where=length > 0)
        return unit

    @cached_property
    def _edges(self) -> topology.Edges:
        return topology.edges(self.mesh.faces)

    @cached_property
    def vertex_normals(self) -> FloatArray:
        """(n, 3) not normalised: the sum of the faces' normals by angle."""
        return self._normals_at(np.arange(len(self.mesh.faces)))

    def _normals_at(self, some: IndexArray) -> FloatArray:
        """(n, 3) the sum by angle of the normals of `some` (k,) faces only."""
        found = np.zeros_like(self.mesh.vertices)
        angles = corner_angles(self.mesh.vertices[self.mesh.faces[some]])
        np.add.at(found, self.mesh.faces[some], angles[:, :, None] * self._face_normals[some, None, :])
        return found

    def closest(self, points: FloatArray) -> Closest:
        """points : (k, 3)."""
        query = o3d.core.Tensor((points - self._centre).astype(np.float32))
        # Each answer is its own: threads change none of them.
        threads = 1 if len(points) < MANY_POINTS else len(os.sched_getaffinity(0))
        face = (
            self._scene.compute_closest_points(query, nthreads=threads)["primitive_ids"]
            .numpy()
            .astype(np.int64)
        )
        point, weights, distance = core.closest_on_faces(
            np.ascontiguousarray(points, dtype=np.float64), self.mesh.vertices, self.mesh.faces, face, threads
        )
        return Closest(point, face, weights, distance, self._face_normals[face])

    def signed_distance(self, points: FloatArray, found: Closest) -> FloatArray:
        """(k,) `found.distance`, negative where the point lies behind the surface (inside a closed one)."""
        side = np.einsum("kd,kd->k", points - found.point, self._pseudonormal(found))
        return np.where(side < 0, -found.distance, found.distance)

    def blocks(self, starts: FloatArray, directions: FloatArray) -> BoolArray:
        """(k,) whether a ray from `starts` (k, 3) along `directions` (k, 3) meets the surface."""
        rays = o3d.core.Tensor(np.concatenate([starts - self._centre, directions], axis=1).astype(np.float32))
        threads = 1 if len(starts) < MANY_POINTS else len(os.sched_getaffinity(0))
        return np.asarray(self._scene.test_occlusions(rays, nthreads=threads).numpy(), dtype=np.bool_)

    def on_open_border(self, found: Closest) -> BoolArray:
        """(k,) whether the closest point lies on an edge that has one triangle only."""
        border_edge = self._edges.count == 1
        border_vertex = np.zeros(len(self.mesh.vertices), dtype=np.bool_)
        border_vertex[self._edges.ends[border_edge].ravel()] = True
        zero = found.weights == 0
        at_vertex = zero.sum(axis=1) == 2
        corner = self.mesh.faces[found.face, found.weights.argmax(axis=1)]
        opposite = self._edges.of_face[found.face, zero.argmax(axis=1)]
        at_edge = zero.sum(axis=1) == 1
        found_on_border: BoolArray = (at_vertex & border_vertex[corner]) | (at_edge & border_edge[opposite])
        return found_on_border

    def _pseudonormal(self, found: Closest) -> FloatArray:
        """(k, 3) not normalised: of the face, the sum over an edge's faces, or a vertex's faces by angle."""
        normal = found.normal.copy()
        zero = found.weights == 0
        at_edge = np.flatnonzero(zero.sum(axis=1) == 1)
        if at_edge.size:
            asked = self._edges.of_face[found.face[at_edge], zero[at_edge].argmax(axis=1)]
            edges, of_asked = np.unique(asked, return_inverse=True)
            number = np.full(len(self._edges.ends), -1)
            number[edges] = np.arange(len(edges))
            face, corner = np.nonzero(number[self._edges.of_face] >= 0)
            of_edge = np.zeros((len(edges), 3))
            np.add.at(of_edge, number[self._edges.of_face[face, corner]], self._face_normals[face])
            normal[at_edge] = of_edge[of_asked]
        at_vertex = np.flatnonzero(zero.sum(axis=1) == 2)
        if at_vertex.size:
            vertex = self.mesh.faces[found.face[at_vertex], found.weights[at_vertex].argmax(axis=1)]
            is_asked = np.zeros(len(self.mesh.vertices), dtype=np.bool_)
            is_asked[vertex] = True
            normal[at_vertex] = self._normals_at(np.flatnonzero(is_asked[self.mesh.faces].any(axis=1)))[
                vertex
            ]
        return normal


def corner_angles(corners: FloatArray) -> FloatArray:
    """(m, 3) interior angle of each triangle (m, 3, 3) at each corner, radians."""
    to_next = np.roll(corners, -1, axis=1) - corners
    to_last = np.roll(corners, 1, axis=1) - corners
    angles: FloatArray = np.arctan2(
        np.linalg.norm(np.cross(to_next, to_last), axis=2), np.einsum("mcd,mcd->mc", to_next, to_last)
    )
    return angles
