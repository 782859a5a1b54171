"""Positions and triangles of a glTF primitive that Draco compressed, by the package DracoPy.

Source: KHR_draco_mesh_compression.
"""

from typing import Any

import numpy as np

from pipeline.core.errors import IndexOutOfRange, MeshTooLarge, UnreadableFile
from pipeline.core.formats import Format
from pipeline.core.mesh import FloatArray, IndexArray
from pipeline.stages.load.extras import require
from pipeline.stages.load.gltf_accessors import Accessors
from pipeline.stages.load.gltf_records import Primitive

DRACO = "KHR_draco_mesh_compression"
DIMENSIONS = 3


def decoded(accessors: Accessors, primitive: Primitive, where: str) -> tuple[FloatArray, IndexArray]:
    """Vertices (n, 3) and triangles (m, 3).

    Raises
    ------
    UnreadableFile, TruncatedFile, IndexOutOfRange, MeshTooLarge
    """
    require("draco", f"the meshes of the {Format.GLB}, which are compressed ({DRACO})")
    import DracoPy

    extension = primitive.extensions[DRACO]
    view = extension.get("bufferView") if isinstance(extension, dict) else None
    attributes = extension.get("attributes") if isinstance(extension, dict) else None
    number = attributes.get("POSITION") if isinstance(attributes, dict) else None
    if not isinstance(view, int) or not isinstance(number, int) or min(view, number) < 0:
        raise UnreadableFile(f"{where} of the {Format.GLB} ({DRACO}) has no buffer view with positions")
    data = accessors.bytes_of_view(view, where)
    try:
        mesh = DracoPy.decode(data)
    except Exception as error:  # of several types, by DracoPy
        raise UnreadableFile(
            f"{where} of the {Format.GLB} cannot be decompressed ({DRACO}): {str(error)[:100]}"
        ) from error
    found = mesh.get_attribute_by_unique_id(number)
    points = None if found is None else np.asarray(found["data"])
    if points is None or points.ndim != 2 or points.shape[1] != DIMENSIONS:
        raise UnreadableFile(
            f"{where} of the {Format.GLB} ({DRACO}) has no attribute {number} with positions"
        )
    faces = np.asarray(getattr(mesh, "faces", np.zeros((0, 3))), dtype=np.int64).reshape(-1, 3)
    settings = accessors.settings
    if not settings.allows(len(points), len(faces)):
        raise MeshTooLarge(
            f"{where} of the {Format.GLB} has {len(faces)} triangles and {len(points)} vertices; "
            f"the limits are {settings.max_faces} and {settings.max_points}"
        )
    if faces.size and int(faces.max()) >= len(points):
        raise IndexOutOfRange(
            f"{where} of the {Format.GLB} ({DRACO}) refers to vertex {faces.max()}, "
            f"but there are {len(points)}"
        )
    normalized = accessors.is_normalized(primitive.attributes["POSITION"], where)
    return _numbers(points, normalized), faces


def _numbers(values: Any, normalized: bool) -> FloatArray:
    numbers = np.asarray(values, dtype=np.float64)
    if normalized and values.dtype.kind in "iu":
        # section 3.6.2.2: the most negative integer is -1 as well
        numbers = np.maximum(numbers / np.iinfo(values.dtype).max, -1.0)
    return numbers
