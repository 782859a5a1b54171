"""First hits of rays on a part, and which of its points are seen from a direction."""

import numpy as np
import open3d as o3d

from pipeline.core.mesh import BoolArray, FloatArray, Mesh

#: Share of the diagonal by which a ray to a point starts off the surface, so that it does not hit it there.
CLEARANCE_SHARE = 1e-3


def scene_of(part: Mesh) -> o3d.t.geometry.RaycastingScene:
    scene = o3d.t.geometry.RaycastingScene(nthreads=1)
    scene.add_triangles(
        o3d.core.Tensor(part.vertices.astype(np.float32)), o3d.core.Tensor(part.faces.astype(np.uint32))
    )
    return scene


def first_hits(part: Mesh, starts: FloatArray, directions: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Distance (k,) mm along unit `directions` (k, 3) from `starts` (k, 3), inf without a hit, and the unit
    normal (k, 3) there.
    """
    rays = np.concatenate([starts, directions], axis=1).astype(np.float32)
    hit = scene_of(part).cast_rays(o3d.core.Tensor(rays), nthreads=1)
    distance_mm = hit["t_hit"].numpy().astype(np.float64)
    on_part = np.flatnonzero(np.isfinite(distance_mm))
    face = hit["primitive_ids"].numpy()[on_part].astype(np.int64)
    cross = part.face_cross_mm2()[face]
    normals = np.zeros((len(distance_mm), 3))
    normals[on_part] = cross / np.linalg.norm(cross, axis=1, keepdims=True)
    # the ray cast is in single precision: it says which triangle, its plane says where
    corner = part.vertices[part.faces[face, 0]]
    height = np.einsum("kd,kd->k", corner - starts[on_part], normals[on_part])
    distance_mm[on_part] = height / np.einsum("kd,kd->k", directions[on_part], normals[on_part])
    return distance_mm, normals


def seen_from(part: Mesh, points: FloatArray, normals: FloatArray, direction: FloatArray) -> BoolArray:
    """(k,) whether nothing of the part lies between each point and a viewer in that direction (3,)."""
    starts = points + CLEARANCE_SHARE * part.diagonal_mm * normals
    rays = np.concatenate([starts, np.broadcast_to(direction, starts.shape)], axis=1).astype(np.float32)
    blocked = scene_of(part).test_occlusions(o3d.core.Tensor(rays), nthreads=1).numpy()
    return np.asarray(~blocked & (normals @ direction > 0))
