"""Skinned meshes of a glTF 2.0, in the pose of their joints. The place of their own node does not count.

Source: glTF 2.0 specification, section 3.7.3.
"""

import numpy as np

from pipeline.core.errors import IndexOutOfRange
from pipeline.core.formats import Format
from pipeline.core.mesh import FloatArray
from pipeline.stages.load.gltf_accessors import Accessors
from pipeline.stages.load.gltf_primitives import Local
from pipeline.stages.load.gltf_records import Primitive


def skinned(
    accessors: Accessors, primitive: Primitive, local: Local, number: int, T_scene_node: FloatArray
) -> tuple[FloatArray, bool] | None:
    """Vertices (n, 3) in the scene, and whether they are mirrored; None where they have no joints.

    Raises
    ------
    UnreadableFile, TruncatedFile, IndexOutOfRange
        With skin and accessor.
    """
    document = accessors.container.document
    if number >= len(document.skins):
        raise IndexOutOfRange(
            f"a node of the {Format.GLB} refers to skin {number}, but there are {len(document.skins)}"
        )
    skin = document.skins[number]
    sets = [k for k in range(8) if {f"JOINTS_{k}", f"WEIGHTS_{k}"} <= set(primitive.attributes)]
    if not sets or not skin.joints:
        return None
    if max(skin.joints) >= len(document.nodes):
        raise IndexOutOfRange(
            f"skin {number} of the {Format.GLB} refers to node {max(skin.joints)}, "
            f"but there are {len(document.nodes)}"
        )
    T_scene_joint = T_scene_node[skin.joints]
    if skin.inverseBindMatrices is not None:
        columns = accessors.floats(skin.inverseBindMatrices, f"skin {number}", "MAT4")
        if len(columns) < len(skin.joints):
            raise IndexOutOfRange(
                f"skin {number} of the {Format.GLB} has {len(skin.joints)} joints and {len(columns)} matrices"
            )
        T_scene_joint = T_scene_joint @ columns[: len(skin.joints)].reshape(-1, 4, 4).transpose(0, 2, 1)
    moved, total = np.zeros_like(local.vertices), np.zeros(len(local.vertices))
    for k in sets:
        joints = accessors.integers(primitive.attributes[f"JOINTS_{k}"], f"joints of skin {number}", "VEC4")
        weights = accessors.floats(primitive.attributes[f"WEIGHTS_{k}"], f"weights of skin {number}", "VEC4")
        if local.rows is None and len(joints) == len(weights) == len(local.vertices):
            pass
        elif local.rows is not None and min(len(joints), len(weights)) > int(local.rows.max(initial=-1)):
            joints, weights = joints[local.rows], weights[local.rows]
        else:
            raise IndexOutOfRange(
                f"skin {number} of the {Format.GLB}: not every vertex has joints and weights"
            )
        if joints.size and int(joints.max()) >= len(skin.joints):
            raise IndexOutOfRange(
                f"a vertex of the {Format.GLB} refers to joint {joints.max()} of skin {number}, "
                f"which has {len(skin.joints)}"
            )
        for corner in range(4):
            T = T_scene_joint[joints[:, corner], :3]
            at = np.einsum("nij,nj->ni", T[:, :, :3], local.vertices) + T[:, :, 3]
            moved += weights[:, corner, None] * at
            total += weights[:, corner]
    # section 3.7.3.3: weights add up to 1, but for rounding
    moved = np.divide(moved, total[:, None], out=local.vertices.copy(), where=total[:, None] > 0)
    mirrored = float(np.median(np.linalg.det(T_scene_joint[:, :3, :3]))) < 0
    return moved, mirrored
