"""glTF binaries for viewers: in metres (required by glTF), decimated if too large, with vertex colours."""

from collections.abc import Callable
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from pipeline.core.mesh import FloatArray, IndexArray, IntArray, Mesh
from pipeline.kernels import remesh
from pipeline.kernels.nearest import nearest

M_PER_MM = 1e-3
#: Radius of the sphere at a landmark over the diagonal of the mesh.
BALL_SHARE = 0.006
BALL_COLOUR = (25, 25, 25)
NOT_COUNTED = 1e31  # glTF has no NaN
#: Codes of glTF 2.0: the component type of a float, and the mode of a primitive of points.
FLOAT, POINTS = 5126, 0


class DisplayMesh:
    """A mesh as it is displayed: at most about `remesh.MANY_FACES` triangles of nearly the same surface.

    full : the original mesh; reduced : a decimated version, if another stage already made one. The mesh is
    decimated on first use and then shared.
    """

    def __init__(self, full: Mesh, reduced: Mesh | None = None) -> None:
        self.full = full
        self._reduced = reduced
        self._original: tuple[DisplayMesh, FloatArray] | None = None

    @cached_property
    def mesh(self) -> Mesh:
        if self.full.is_cloud or len(self.full.faces) <= remesh.MANY_FACES:
            return self.full
        if self._original is not None:
            unmoved, T_here_original = self._original
            return unmoved.mesh.moved(T_here_original)
        return remesh.decimated(self.full, remesh.MANY_FACES // 2) if self._reduced is None else self._reduced

    @cached_property
    def _of_full(self) -> IndexArray | None:
        if self._original is not None:
            return self._original[0]._of_full
        return None if self.mesh is self.full else nearest(self.full.vertices, self.mesh.vertices)[1]

    def values(self, of_full: FloatArray) -> FloatArray:
        """(k, ...) for each vertex that is shown the value (n, ...) of the nearest one of the full mesh."""
        return of_full if self._of_full is None else of_full[self._of_full]

    def moved(self, T_target_mesh: FloatArray) -> "DisplayMesh":
        """The same in another frame."""
        other = DisplayMesh(self.full.moved(T_target_mesh))
        other._original = self, T_target_mesh
        return other


def write_glb(
    path: Path,
    display: DisplayMesh,
    colours: FloatArray,
    landmarks_mm: FloatArray | None = None,
    deviation_mm: FloatArray | None = None,
) -> None:
    """One node `surface`, and one `landmarks` of small balls where `landmarks_mm` is given.

    deviation_mm : (n,) of each vertex, NaN where it is not counted: the attribute `_DEVIATION_MM`,
    `NOT_COUNTED` for NaN
    """
    import trimesh

    if deviation_mm is not None:
        colours = np.column_stack([colours, np.nan_to_num(deviation_mm, nan=NOT_COUNTED)])
    mesh, colours = display.mesh, display.values(colours)
    extra = {} if deviation_mm is None else {"_DEVIATION_MM": colours[:, 3].astype(np.float32)}
    colours = colours[:, :3]
    painted = np.column_stack([np.rint(255 * colours), np.full(len(colours), 255)]).astype(np.uint8)
    vertices = mesh.vertices * M_PER_MM
    scene = trimesh.Scene()
    if mesh.is_cloud:
        scene.add_geometry(
            trimesh.PointCloud(vertices, colors=painted), node_name="surface", geom_name="surface"
        )
    else:
        shape = trimesh.Trimesh(
            vertices, mesh.faces, vertex_colors=painted, vertex_attributes=extra, process=False
        )
        scene.add_geometry(shape, node_name="surface", geom_name="surface")
    if landmarks_mm is not None and len(landmarks_mm):
        balls = _balls(landmarks_mm, BALL_SHARE * mesh.diagonal_mm)
        scene.add_geometry(balls, node_name="landmarks", geom_name="landmarks")
    values = extra.get("_DEVIATION_MM") if mesh.is_cloud else None
    processor = None if values is None else _attribute_of_points("_DEVIATION_MM", values)
    path.write_bytes(scene.export(file_type="glb", buffer_postprocessor=processor))


def _attribute_of_points(name: str, values: npt.NDArray[np.float32]) -> Callable[[Any, Any], None]:
    """For trimesh, which writes attributes of triangles, but of points only the colours. values : (n,)"""

    def add(buffers: Any, tree: Any) -> None:
        buffers[name] = values.astype("<f4").tobytes()  # 4 bytes each, as the views must be aligned
        tree["accessors"][name] = {
            "bufferView": len(buffers) - 1,
            "byteOffset": 0,
            "componentType": FLOAT,
            "count": len(values),
            "type": "SCALAR",
        }
        (points,) = [each for mesh in tree["meshes"] for each in mesh["primitives"] if each["mode"] == POINTS]
        points["attributes"][name] = len(tree["accessors"]) - 1

    return add


def _balls(centres_mm: FloatArray, radius_mm: float) -> Any:
    import trimesh

    ball = trimesh.creation.icosphere(subdivisions=1, radius=radius_mm)
    vertices = (centres_mm[:, None, :] + ball.vertices[None]).reshape(-1, 3) * M_PER_MM
    steps = np.arange(len(centres_mm))[:, None, None] * len(ball.vertices)
    faces: IntArray = (ball.faces[None] + steps).reshape(-1, 3).astype(np.int32)
    colours = np.tile(np.array([*BALL_COLOUR, 255], dtype=np.uint8), (len(vertices), 1))
    return trimesh.Trimesh(vertices, faces, vertex_colors=colours, process=False)
