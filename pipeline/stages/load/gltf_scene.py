"""The nodes of a glTF 2.0: where they are, and which ones the default scene shows.

Source: glTF 2.0 specification, section 3.5; KHR_node_visibility.
"""

from dataclasses import dataclass

import numpy as np

from pipeline.core.errors import IndexOutOfRange, UnreadableFile
from pipeline.core.formats import Format
from pipeline.core.mesh import FloatArray, IndexArray
from pipeline.stages.load.gltf_extensions import VISIBILITY
from pipeline.stages.load.gltf_left_out import ELSEWHERE, HIDDEN, LeftOut
from pipeline.stages.load.gltf_records import Document, Node


@dataclass(frozen=True, slots=True, eq=False)
class Placed:
    """T_scene_node : (n, 4, 4) of all nodes; shown : nodes of the default scene, parents before children"""

    T_scene_node: FloatArray
    shown: list[int]


def place(document: Document, left_out: LeftOut) -> Placed:
    """Where the nodes are, and which ones are shown; what is not shown is added to `left_out`.

    Raises
    ------
    UnreadableFile, IndexOutOfRange
        With the node.
    """
    nodes = document.nodes
    parents = _parents(nodes)
    T_scene_node = np.zeros((len(nodes), 4, 4))
    roots = [index for index, parent in enumerate(parents) if parent < 0]
    order = _with_children(roots, nodes)
    if len(order) < len(nodes):
        lost = min(set(range(len(nodes))) - set(order))
        raise UnreadableFile(f"node {lost} of the {Format.GLB} is its own ancestor")
    with np.errstate(over="ignore", invalid="ignore"):  # what overflows is refused as not finite
        for index in order:
            local = _local(nodes[index], index)
            parent = parents[index]
            T_scene_node[index] = T_scene_node[parent] @ local if parent >= 0 else local
    starts = _starts(document, roots)
    hidden = [index for index in order if _is_hidden(nodes[index])]
    shown = _with_children(starts, nodes, without=frozenset(hidden))
    in_scene = set(_with_children(starts, nodes)) if hidden or len(shown) < len(nodes) else set(shown)
    for index in order:
        if index not in in_scene and nodes[index].mesh is not None:
            left_out.add(ELSEWHERE, nodes[index].name)
    for index in hidden:
        if index in in_scene:
            left_out.add(HIDDEN, nodes[index].name)
    return Placed(T_scene_node, shown)


def _starts(document: Document, roots: list[int]) -> list[int]:
    """The nodes that the default scene names; without scenes, all roots."""
    scenes = document.scenes
    if not scenes:
        return roots
    number = document.scene or 0  # section 3.5.1: without `scene`, the choice is free
    if number >= len(scenes):
        raise IndexOutOfRange(f"the {Format.GLB} shows scene {number}, but there are {len(scenes)}")
    for index in scenes[number].nodes:
        if index >= len(document.nodes):
            raise IndexOutOfRange(
                f"scene {number} of the {Format.GLB} refers to node {index}, "
                f"but there are {len(document.nodes)}"
            )
    return scenes[number].nodes


def _parents(nodes: list[Node]) -> IndexArray:
    """(n,) the parent of each node, or -1."""
    parents = np.full(len(nodes), -1)
    for index, node in enumerate(nodes):
        for child in node.children:
            if child >= len(nodes):
                raise IndexOutOfRange(
                    f"node {index} of the {Format.GLB} has node {child} as a child, "
                    f"but there are {len(nodes)}"
                )
            if parents[child] >= 0:
                raise UnreadableFile(
                    f"node {child} of the {Format.GLB} is a child twice, "
                    f"of nodes {parents[child]} and {index}"
                )
            parents[child] = index
    return parents


def _with_children(starts: list[int], nodes: list[Node], without: frozenset[int] = frozenset()) -> list[int]:
    """The nodes and all below, each once, depth first; `without` some and what is below them."""
    order: list[int] = []
    seen: set[int] = set()
    stack = list(reversed(starts))
    while stack:
        index = stack.pop()
        if index in seen or index in without:
            continue
        seen.add(index)
        order.append(index)
        stack.extend(reversed(nodes[index].children))
    return order


def _is_hidden(node: Node) -> bool:
    extension = node.extensions.get(VISIBILITY)
    return isinstance(extension, dict) and extension.get("visible") is False


def _local(node: Node, index: int) -> FloatArray:
    """(4, 4) from the node to its parent."""
    if node.matrix is not None:
        matrix = np.array(node.matrix).reshape(4, 4).T  # column after column
        if not np.array_equal(matrix[3], [0, 0, 0, 1]):
            raise UnreadableFile(
                f"the matrix of node {index} of the {Format.GLB} is no affine transform: it ends in "
                f"{matrix[3].tolist()}, not 0 0 0 1"
            )
        return np.asarray(matrix)
    translation, rotation, scale = (np.array([p]) for p in (node.translation, node.rotation, node.scale))
    return np.asarray(transforms(translation, rotation, scale, f"node {index}")[0])


def transforms(translation: FloatArray, rotation: FloatArray, scale: FloatArray, where: str) -> FloatArray:
    """(k, 4, 4) of translations (k, 3), unit quaternions x y z w (k, 4) and scales (k, 3): T R S.

    Raises
    ------
    UnreadableFile
        For a quaternion without length.
    """
    length = np.linalg.norm(rotation, axis=1)
    if not ((length > 0) & np.isfinite(length)).all():
        raise UnreadableFile(f"the rotation of {where} of the {Format.GLB} is a quaternion without length")
    x, y, z, w = (rotation / length[:, None]).T
    matrices = np.zeros((len(rotation), 4, 4))
    matrices[:, :3, 0] = np.column_stack([1 - 2 * (y * y + z * z), 2 * (x * y + z * w), 2 * (x * z - y * w)])
    matrices[:, :3, 1] = np.column_stack([2 * (x * y - z * w), 1 - 2 * (x * x + z * z), 2 * (y * z + x * w)])
    matrices[:, :3, 2] = np.column_stack([2 * (x * z + y * w), 2 * (y * z - x * w), 1 - 2 * (x * x + y * y)])
    matrices[:, :3, :3] *= scale[:, None, :]
    matrices[:, :3, 3] = translation
    matrices[:, 3, 3] = 1.0
    return matrices
