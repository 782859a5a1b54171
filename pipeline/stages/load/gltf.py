"""glTF 2.0: the triangles or points that its default scene shows, in metres.

A GLB, JSON with embedded buffers, or JSON and its buffers in a zip archive. Materials, textures, cameras,
lights and animations are not used.
Source: glTF 2.0 specification, Khronos, 2021 (ISO/IEC 12113:2022).
"""

from dataclasses import dataclass, field

import numpy as np

from pipeline.core.errors import IndexOutOfRange, MeshTooLarge, UnreadableFile
from pipeline.core.formats import ZIP, Format
from pipeline.core.mesh import FloatArray
from pipeline.core.settings import LoadSettings
from pipeline.stages.load.contents import Body, Contents, FilePart
from pipeline.stages.load.gltf_accessors import Accessors
from pipeline.stages.load.gltf_archive import open_archive
from pipeline.stages.load.gltf_brep import brep_faces_of
from pipeline.stages.load.gltf_container import open_container
from pipeline.stages.load.gltf_extensions import INSTANCING, check_required
from pipeline.stages.load.gltf_left_out import (
    CLOUDS,
    EMPTY,
    LINES,
    MORPHS,
    REMAINDER,
    SKINS,
    LeftOut,
)
from pipeline.stages.load.gltf_primitives import Local, Primitives, has_shape
from pipeline.stages.load.gltf_records import Document, Node, Primitive
from pipeline.stages.load.gltf_scene import place, transforms
from pipeline.stages.load.gltf_skin import skinned

IDENTITY = np.eye(4)


def read_glb(data: bytes, settings: LoadSettings) -> Contents:
    """One body for each primitive of each node, in the frame of the scene.

    Notes: `left_out_of_gltf`, `morph_ignored`, `skin_ignored`.

    Raises
    ------
    UnreadableFile, TruncatedFile, IndexOutOfRange, MeshTooLarge
        With node, mesh, primitive or accessor.
    """
    container = open_archive(data, settings) if data.startswith(ZIP) else open_container(data)
    check_required(container.document)
    accessors = Accessors(container, settings)
    builder = _Builder(container.document, accessors, Primitives(accessors), settings)
    with np.errstate(over="ignore", invalid="ignore"):  # what overflows is refused as not finite
        builder.build()
    bodies, left_out = builder.bodies, builder.left_out
    if not bodies:
        found = ", ".join(left_out.phrase(reason) for reason in left_out.found)
        raise UnreadableFile(
            f"the {Format.GLB} shows no triangles and no points" + (f", only {found}" if found else ""),
            remedy="export the part as a mesh, visible and in the default scene",
        )
    if any(len(body.faces) for body in bodies):
        for body in bodies:
            if not len(body.faces):
                left_out.add(CLOUDS, body.name)
        bodies = [body for body in bodies if len(body.faces)]
    return Contents(tuple(bodies), unit="meter", notes=left_out.notes())


@dataclass(slots=True, eq=False)
class _Builder:
    document: Document
    accessors: Accessors
    primitives: Primitives
    settings: LoadSettings
    bodies: list[Body] = field(default_factory=list)
    left_out: LeftOut = field(default_factory=LeftOut)
    n_vertices: int = 0
    n_faces: int = 0
    n_placed: int = 0

    def build(self) -> None:
        if not self.document.nodes:  # a file of meshes only: each where it is
            for mesh in range(len(self.document.meshes)):
                self._place_mesh(Node(mesh=mesh), 0, IDENTITY[None], np.zeros((0, 4, 4)))
            return
        placed = place(self.document, self.left_out)
        for index in placed.shown:
            node = self.document.nodes[index]
            if node.mesh is not None:
                T_scene_mesh = placed.T_scene_node[index][None]
                if INSTANCING in node.extensions:
                    T_scene_mesh = T_scene_mesh @ self._instances(node, index)
                self._place_mesh(node, index, T_scene_mesh, placed.T_scene_node)

    def _place_mesh(self, node: Node, index: int, T_scene_mesh: FloatArray, T_scene_node: FloatArray) -> None:
        """Add the bodies of a mesh, at each of the transforms (k, 4, 4)."""
        number = node.mesh or 0
        if number >= len(self.document.meshes):
            raise IndexOutOfRange(
                f"node {index} of the {Format.GLB} refers to mesh {number}, "
                f"but there are {len(self.document.meshes)}"
            )
        mesh = self.document.meshes[number]
        name = node.name or mesh.name
        if any(primitive.targets for primitive in mesh.primitives):
            self.left_out.add(MORPHS, name)
        part = FilePart(self.n_placed, name)
        self.n_placed += 1
        for position, primitive in enumerate(mesh.primitives):
            if not has_shape(primitive):
                # Draco may hide the positions, and does not hide lines
                reason = EMPTY if "POSITION" not in primitive.attributes else LINES
                self.left_out.add(reason, name)
                continue
            local = self.primitives.read(number, position)
            if local.has_remainder:
                self.left_out.add(REMAINDER, name)
            self._count(len(T_scene_mesh), local)
            self._place(node, primitive, local, T_scene_mesh, T_scene_node, part)

    def _place(
        self,
        node: Node,
        primitive: Primitive,
        local: Local,
        T_scene_mesh: FloatArray,
        T_scene_node: FloatArray,
        part: FilePart,
    ) -> None:
        if node.skin is not None:
            posed = None
            if not local.is_decoded:
                posed = skinned(self.accessors, primitive, local, node.skin, T_scene_node)
            if posed is not None:
                vertices, is_mirrored = posed
                faces = local.faces[:, ::-1] if is_mirrored else local.faces
                self._add(Body(vertices, faces, part.name, part))
                return
            self.left_out.add(SKINS, part.name)
        linear, offset = T_scene_mesh[:, :3, :3], T_scene_mesh[:, :3, 3]
        vertices = np.einsum("kij,nj->kni", linear, local.vertices) + offset[:, None]
        # section 3.7.4: a transform that mirrors turns the triangles over
        mirrored = np.linalg.det(linear) < 0
        faces = np.where(mirrored[:, None, None], local.faces[:, ::-1], local.faces)
        faces = faces + np.arange(len(linear))[:, None, None] * len(local.vertices)
        brep = None
        if len(linear) == 1:
            brep = brep_faces_of(self.accessors, primitive, len(local.faces), f"node {node.name!r}")
        self._add(Body(vertices.reshape(-1, 3), faces.reshape(-1, 3), part.name, part, brep=brep))

    def _add(self, body: Body) -> None:
        if len(body.vertices):
            self.bodies.append(body)

    def _instances(self, node: Node, index: int) -> FloatArray:
        """(k, 4, 4) of EXT_mesh_gpu_instancing: translations, rotations and scales of copies of the mesh."""
        where = f"instances of node {index}"
        extension = node.extensions[INSTANCING]
        attributes = extension.get("attributes") if isinstance(extension, dict) else None
        if not isinstance(attributes, dict) or not all(isinstance(each, int) for each in attributes.values()):
            raise UnreadableFile(f"the {where} of the {Format.GLB} ({INSTANCING}) have no attributes")
        kinds = {"TRANSLATION": "VEC3", "ROTATION": "VEC4", "SCALE": "VEC3"}
        read = {
            key: self.accessors.floats(attributes[key], where, kind)
            for key, kind in kinds.items()
            if attributes.get(key, -1) >= 0
        }
        counts = {len(values) for values in read.values()}
        if len(counts) > 1:
            raise UnreadableFile(f"the {where} of the {Format.GLB} have attributes of different lengths")
        if not read:
            return IDENTITY[None]
        one = np.ones((counts.pop(), 1))
        return transforms(
            read.get("TRANSLATION", one * [0.0, 0.0, 0.0]),
            read.get("ROTATION", one * [0.0, 0.0, 0.0, 1.0]),
            read.get("SCALE", one * [1.0, 1.0, 1.0]),
            where,
        )

    def _count(self, copies: int, local: Local) -> None:
        self.n_vertices += copies * len(local.vertices)
        self.n_faces += copies * len(local.faces)
        if not self.settings.allows(self.n_vertices, self.n_faces):
            raise MeshTooLarge(
                f"the {Format.GLB} shows at least {self.n_faces} triangles and {self.n_vertices} vertices; "
                f"the limits are {self.settings.max_faces} and {self.settings.max_points}"
            )
