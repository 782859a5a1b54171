"""The faces of a CAD model in a GLB: extension TM_brep_faces, as `cascadio` writes it.

Each triangle has the number of its face, and each face has the kind of its surface.
"""

import numpy as np

from pipeline.core.brep_faces import BrepFace, BrepFaces
from pipeline.stages.load.gltf_accessors import Accessors
from pipeline.stages.load.gltf_records import Primitive

EXTENSION = "TM_brep_faces"
OTHER = "other"


def brep_faces_of(accessors: Accessors, primitive: Primitive, count: int, where: str) -> BrepFaces | None:
    """The faces of a primitive of `count` triangles; None where it has none, or they are not in order."""
    extension = primitive.extensions.get(EXTENSION)
    if not isinstance(extension, dict):
        return None
    accessor, listed = extension.get("faceIndices"), extension.get("faces")
    if not isinstance(accessor, int) or not isinstance(listed, list):
        return None
    of_triangle = accessors.integers(accessor, f"faces of {where}")[:, 0]
    kinds = {
        each["face_index"]: str(each.get("type", OTHER))
        for each in listed
        if isinstance(each, dict) and isinstance(each.get("face_index"), int)
    }
    if len(of_triangle) != count or not count:
        return None
    numbers, renumbered = np.unique(of_triangle, return_inverse=True)
    faces = tuple(BrepFace("", kinds.get(int(number), OTHER)) for number in numbers)
    return BrepFaces(renumbered.astype(np.int32), faces)
