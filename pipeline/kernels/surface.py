"""Closest points and signed distances on a triangle surface.

A tree of bounding boxes (`native/surface_tree.hpp`) finds the closest point in double precision; of
triangles that are equally near it is that of the smallest index. The sign follows Baerentzen & Aanaes,
"Signed distance computation using the angle weighted pseudonormal" (2005), which is correct at edges and
vertices too. Rays are cast by open3d (Embree, single precision).
"""

import os
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import open3d as o3d

from pipeline.core.mesh import BoolArray, FloatArray, IndexArray, Mesh
from pipeline.kernels import topology
from pipeline.kernels.chords import Chords
from pipeline.kernels.native import core


@dataclass(frozen=True, slots=True)
class Closest:
    """Closest points of k queries.

    point : (k, 3) mm, on the surface; face : (k,) int64, its triangle; weights : (k, 3) barycentric
    coordinates, with two exact zeros at a vertex, one on an edge and none inside; distance : (k,) mm, >= 0;
    normal : (k, 3) unit normal of the triangle
    """

    point: FloatArray
    face: IndexArray
    weights: FloatArray
    distance: FloatArray
    normal: FloatArray

    def of(self, chosen: IndexArray) -> "Closest":
        """Of the queries `chosen` (j,) only."""
        return Closest(
            self.point[chosen],
            self.face[chosen],
            self.weights[chosen],
            self.distance[chosen],
            self.normal[chosen],
        )


#: Queries from which starting threads pays off; affects run time only.
MANY_POINTS = 1_000


class Surface:
    """A triangle surface prepared for many closest-point and ray queries. All coordinates are in the mesh
    frame, mm.
    """

    def __init__(self, mesh: Mesh) -> None:
        self.mesh = mesh
        self.target = core.SurfaceTarget(mesh.vertices, mesh.faces)

    @cached_property
    def _scene(self) -> tuple[o3d.t.geometry.RaycastingScene, FloatArray]:
        """For rays, with its origin (3,): single precision is relative to it, so the part is centred."""
        centre = (self.mesh.vertices.min(axis=0) + self.mesh.vertices.max(axis=0)) / 2
        scene = o3d.t.geometry.RaycastingScene(nthreads=1)
        scene.add_triangles(
            o3d.core.Tensor((self.mesh.vertices - centre).astype(np.float32)),
            o3d.core.Tensor(self.mesh.faces.astype(np.uint32)),
        )
        return scene, centre

    @cached_property
    def _face_normals(self) -> FloatArray:
        cross = self.mesh.face_cross_mm2()
        length = np.linalg.norm(cross, axis=1, keepdims=True)
        unit: FloatArray = np.divide(cross, length, out=np.zeros_like(cross), where=length > 0)
        return unit

    @cached_property
    def edges(self) -> topology.Edges:
        """The edges of the mesh."""
        return topology.edges(self.mesh.faces)

    @cached_property
    def chords(self) -> Chords:
        """What the triangles of the mesh leave out between their corners."""
        return Chords.of(self.mesh, self.edges)

    @cached_property
    def vertex_normals(self) -> FloatArray:
        """(n, 3) angle-weighted sums of the normals of the adjacent triangles; not normalised."""
        return self._normals_at(np.arange(len(self.mesh.faces)))

    def _normals_at(self, selected: IndexArray) -> FloatArray:
        """(n, 3) angle-weighted sums of the normals of the `selected` (k,) triangles only."""
        normals = np.zeros_like(self.mesh.vertices)
        angles = corner_angles(self.mesh.vertices[self.mesh.faces[selected]])
        np.add.at(
            normals, self.mesh.faces[selected], angles[:, :, None] * self._face_normals[selected, None, :]
        )
        return normals

    def closest(self, points: FloatArray, near: IndexArray | None = None) -> Closest:
        """The closest point of the surface for each of `points` (k, 3), mm.

        near : (k,) a triangle for each point that is likely near, as of the last step of an ICP; it makes the
        search quicker and changes no result.
        """
        points = np.ascontiguousarray(points, dtype=np.float64)
        near = None if near is None else np.ascontiguousarray(near, dtype=np.int64)
        point, face, weights, distance = self.target.closest(points, near, threads_for(len(points)))
        return Closest(point, face, weights, distance, self._face_normals[face])

    def signed_distance(self, points: FloatArray, closest: Closest) -> FloatArray:
        """(k,) mm: `closest.distance`, negative behind the surface (inside a closed one).

        points : (k, 3) mm; closest : the result of `closest(points)`
        """
        side = np.einsum("kd,kd->k", points - closest.point, self._pseudonormal(closest))
        return np.where(side < 0, -closest.distance, closest.distance)

    def intersects_rays(self, starts: FloatArray, directions: FloatArray) -> BoolArray:
        """(k,) whether the ray from `starts` (k, 3) mm along `directions` (k, 3) hits the surface."""
        scene, centre = self._scene
        rays = o3d.core.Tensor(np.concatenate([starts - centre, directions], axis=1).astype(np.float32))
        hit = scene.test_occlusions(rays, nthreads=threads_for(len(starts)))
        return np.asarray(hit.numpy(), dtype=np.bool_)

    def intersects_segments(self, starts: FloatArray, ends: FloatArray) -> BoolArray:
        """(k,) whether the segment from `starts` (k, 3) mm to `ends` (k, 3) mm meets the surface."""
        scene, centre = self._scene
        rays = o3d.core.Tensor(np.concatenate([starts - centre, ends - starts], axis=1).astype(np.float32))
        hit = scene.test_occlusions(rays, tfar=1.0, nthreads=threads_for(len(starts)))
        return np.asarray(hit.numpy(), dtype=np.bool_)

    def on_open_border(self, closest: Closest) -> BoolArray:
        """(k,) whether the closest point lies on an open border (an edge with one triangle)."""
        border_edge = self.edges.count == 1
        border_vertex = np.zeros(len(self.mesh.vertices), dtype=np.bool_)
        border_vertex[self.edges.ends[border_edge].ravel()] = True
        zero = closest.weights == 0
        at_vertex = zero.sum(axis=1) == 2
        corner = self.mesh.faces[closest.face, closest.weights.argmax(axis=1)]
        opposite = self.edges.of_face[closest.face, zero.argmax(axis=1)]
        at_edge = zero.sum(axis=1) == 1
        on_border: BoolArray = (at_vertex & border_vertex[corner]) | (at_edge & border_edge[opposite])
        return on_border

    def _pseudonormal(self, closest: Closest) -> FloatArray:
        """(k, 3) angle-weighted pseudonormals (Baerentzen & Aanaes, 2005, section 3); not normalised."""
        normal = closest.normal.copy()
        zero = closest.weights == 0
        at_edge = np.flatnonzero(zero.sum(axis=1) == 1)
        if at_edge.size:
            queried = self.edges.of_face[closest.face[at_edge], zero[at_edge].argmax(axis=1)]
            edges, of_query = np.unique(queried, return_inverse=True)
            number = np.full(len(self.edges.ends), -1)
            number[edges] = np.arange(len(edges))
            face, corner = np.nonzero(number[self.edges.of_face] >= 0)
            of_edge = np.zeros((len(edges), 3))
            np.add.at(of_edge, number[self.edges.of_face[face, corner]], self._face_normals[face])
            normal[at_edge] = of_edge[of_query]
        at_vertex = np.flatnonzero(zero.sum(axis=1) == 2)
        if at_vertex.size:
            vertex = self.mesh.faces[closest.face[at_vertex], closest.weights[at_vertex].argmax(axis=1)]
            is_queried = np.zeros(len(self.mesh.vertices), dtype=np.bool_)
            is_queried[vertex] = True
            normal[at_vertex] = self._normals_at(np.flatnonzero(is_queried[self.mesh.faces].any(axis=1)))[
                vertex
            ]
        return normal


def threads_for(count: int) -> int:
    """Threads for so many independent queries; their number changes no result."""
    return 1 if count < MANY_POINTS else len(os.sched_getaffinity(0))


def corner_angles(corners: FloatArray) -> FloatArray:
    """(m, 3) interior angle of each triangle (m, 3, 3) at each corner, radians."""
    to_next = np.roll(corners, -1, axis=1) - corners
    to_last = np.roll(corners, 1, axis=1) - corners
    angles: FloatArray = np.arctan2(
        np.linalg.norm(np.cross(to_next, to_last), axis=2), np.einsum("mcd,mcd->mc", to_next, to_last)
    )
    return angles
