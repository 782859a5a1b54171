"""Builds what the <build> section of a 3MF names: components with their transforms, through all parts.

Points are row vectors, and a transform is (A, b) with p' = p A + b (3MF core specification, section 3.3).
Points of a component in another part are first scaled to the unit of the part that refers to it.
"""

from dataclasses import dataclass, field, replace

import numpy as np

from pipeline.core.errors import MeshTooLarge, UnitUnknown, UnreadableFile
from pipeline.core.mesh import FloatArray, IndexArray
from pipeline.core.settings import LoadSettings
from pipeline.stages.load.contents import Body, FilePart
from pipeline.stages.load.three_mf_left_out import (
    EMPTY,
    NOT_PRINTABLE,
    LeftOut,
    of_geometry,
    of_kind,
    of_role,
)
from pipeline.stages.load.three_mf_model import read_model
from pipeline.stages.load.three_mf_package import Package
from pipeline.stages.load.three_mf_records import Model, Object, Use, wrong_face
from pipeline.stages.load.three_mf_roles import Part, Range, Roles
from pipeline.stages.load.units import DECLARED

#: Max levels of components, and max meshes that are placed. Chosen by hand: real plates have three levels and
#: some hundred meshes.
MAX_DEPTH, MAX_PLACED = 64, 100_000


@dataclass(frozen=True, slots=True)
class _Size:
    """Of an object with all its components: triangles, and objects that have geometry."""

    triangles: int
    meshes: int


@dataclass(slots=True)
class Plate:
    """bodies : the meshes of the part; items : names of the build items that they are from; left_out : what
    is not part of it
    """

    bodies: list[Body] = field(default_factory=list)
    items: list[str] = field(default_factory=list)
    left_out: LeftOut = field(default_factory=LeftOut)


class Builder:
    """Reads parts when they are first referred to. root : the model that the package starts from"""

    def __init__(self, package: Package, roles: Roles, settings: LoadSettings) -> None:
        self._package, self._roles, self._settings = package, roles, settings
        self._models: dict[str, Model] = {}
        self._sizes: dict[tuple[str, str], _Size] = {}
        self.root = self._model(package.root_model())

    def build(self, kinds: frozenset[str]) -> Plate:
        """All build items of the root model. kinds : types of objects that are part of the print

        Raises
        ------
        MeshTooLarge, UnreadableFile, TruncatedFile, IndexOutOfRange, UnitUnknown
        """
        targets = [self._target(self.root, item) for item in self.root.items]
        sizes = [self._size(model, thing, ()) for model, thing in targets]
        triangles, meshes = sum(each.triangles for each in sizes), sum(each.meshes for each in sizes)
        if triangles > self._settings.max_faces:
            raise MeshTooLarge(
                f"the 3MF builds {triangles} triangles; the limit is {self._settings.max_faces}"
            )
        if meshes > MAX_PLACED:
            raise MeshTooLarge(
                f"the 3MF builds {meshes} meshes; the limit is {MAX_PLACED}",
                remedy="join the meshes of the part and export it as binary STL",
            )
        plate = Plate()
        for item, (model, thing) in zip(self.root.items, targets, strict=True):
            name = self._name(model, thing)
            if not item.printable:
                plate.left_out.add(NOT_PRINTABLE, name, self._size(model, thing, ()).triangles)
                continue
            if not self._size(model, thing, ()).meshes:  # a body without content, as Fusion writes it
                plate.left_out.add(EMPTY, name, 0)
                continue
            before = len(plate.bodies)
            self._place(plate, model, thing, self._linear(self.root, item, model), kinds, name)
            if len(plate.bodies) > before:
                part = FilePart(len(plate.items), name)
                plate.bodies[before:] = [replace(body, part=part) for body in plate.bodies[before:]]
                plate.items.append(name)
        return plate

    def unused(self) -> list[tuple[str, int]]:
        """Names and triangles of the objects of the parts read that no build item needs."""
        return [
            (self._name(model, thing), len(thing.faces))
            for model in self._models.values()
            for thing in model.objects.values()
            if (model.part, thing.object_id) not in self._sizes
        ]

    def _place(
        self,
        plate: Plate,
        model: Model,
        thing: Object,
        to_plate: tuple[FloatArray, FloatArray],
        kinds: frozenset[str],
        name: str,
        role: str | None = None,
    ) -> None:
        """Add the meshes of an object and of its components. role : that its parent gives it"""
        size = self._size(model, thing, ())
        role = role or thing.role
        for geometry in dict.fromkeys(thing.unread):
            if geometry != "slices" or not size.triangles:  # slices repeat the triangles
                plate.left_out.add(of_geometry(geometry), name, 0)
        if not size.meshes:
            return
        if role is not None:
            plate.left_out.add(of_role(role), name, size.triangles)
        elif thing.kind not in kinds:
            plate.left_out.add(of_kind(thing.kind), name, size.triangles)
        else:
            if len(thing.faces):
                self._add_mesh(plate, model, thing, to_plate, name)
            linear, offset = to_plate
            seen: dict[str, int] = {}
            for use in thing.components:
                inner_model, inner = self._target(model, use)
                occurrence = seen.get(use.object_id, 0)
                seen[use.object_id] = occurrence + 1
                part = self._part(model, thing, use, occurrence)
                inner_linear, inner_offset = self._linear(model, use, inner_model)
                with np.errstate(invalid="ignore", over="ignore"):
                    placed = (inner_linear @ linear, inner_offset @ linear + offset)
                called = inner.name or part.name or self._name(inner_model, inner)
                self._place(plate, inner_model, inner, placed, kinds, called, part.role)

    def _add_mesh(
        self, plate: Plate, model: Model, thing: Object, to_plate: tuple[FloatArray, FloatArray], name: str
    ) -> None:
        if thing.faces.min() < 0 or thing.faces.max() >= len(thing.vertices):
            raise wrong_face(model.part, self._package.read(model.part), thing, len(thing.vertices))
        linear, offset = to_plate
        with np.errstate(invalid="ignore", over="ignore"):  # such vertices are refused with the mesh
            vertices = thing.vertices @ linear + offset
            mirrored = bool(np.linalg.det(linear) < 0)
        ranges = thing.ranges
        if model is self.root:
            ranges = ranges + self._roles.ranges.get(thing.object_id, [])
        faces = _without_roles(thing.faces, ranges, plate.left_out, name)
        if len(faces) == 0:
            return
        if len(faces) < len(thing.faces):
            used, faces = np.unique(faces, return_inverse=True)
            vertices, faces = vertices[used], faces.reshape(-1, 3)
        plate.bodies.append(Body(vertices, faces[:, ::-1] if mirrored else faces, name))

    def _part(self, model: Model, thing: Object, use: Use, occurrence: int) -> Part:
        if model is not self.root:
            return Part(None)
        return self._roles.part(thing.object_id, use.object_id, occurrence)

    def _name(self, model: Model, thing: Object) -> str:
        named = self._roles.names.get(thing.object_id, "") if model is self.root else ""
        return thing.name or named or f"object {thing.object_id}"

    def _size(self, model: Model, thing: Object, path: tuple[tuple[str, str], ...]) -> _Size:
        """path : of the objects that contain it."""
        key = (model.part, thing.object_id)
        if key in path:
            ids = " > ".join(object_id for _, object_id in (*path[path.index(key) :], key))
            raise UnreadableFile(f"{model.part} in the 3MF: an object is a component of itself ({ids})")
        if len(path) >= MAX_DEPTH:
            raise UnreadableFile(
                f"{model.part} in the 3MF: components are nested more than {MAX_DEPTH} levels deep"
            )
        if key not in self._sizes:
            inner = [self._size(*self._target(model, use), (*path, key)) for use in thing.components]
            self._sizes[key] = _Size(
                len(thing.faces) + sum(each.triangles for each in inner),
                int(len(thing.faces) > 0 or bool(thing.unread)) + sum(each.meshes for each in inner),
            )
        return self._sizes[key]

    def _target(self, model: Model, use: Use) -> tuple[Model, Object]:
        """The object that a component or build item refers to, and its part."""
        target = model
        if use.path is not None:
            name = self._package.part(use.path, model.part)
            if name is None:
                raise UnreadableFile(f"{self._where(use)}: the 3MF has no part {use.path}")
            target = self._model(name)
        thing = target.objects.get(use.object_id)
        if thing is None:
            raise UnreadableFile(f"{self._where(use)}: {target.part} has no object {use.object_id}")
        return target, thing

    def _model(self, part: str) -> Model:
        if part not in self._models:
            self._models[part] = read_model(part, self._package.read(part))
        return self._models[part]

    def _linear(self, model: Model, use: Use, target: Model) -> tuple[FloatArray, FloatArray]:
        """(A, b) from the unit and frame of the object to those of `model`."""
        scale = 1.0
        if target.unit != model.unit:
            for each in (model, target):
                if each.unit not in DECLARED:
                    raise UnitUnknown(f"{each.part} in the 3MF declares the unit {each.unit!r}")
            scale = DECLARED[target.unit][1] / DECLARED[model.unit][1]
        with np.errstate(over="ignore"):  # such vertices are refused with the mesh
            return scale * use.transform[:3], use.transform[3]

    def _where(self, use: Use) -> str:
        return use.place.text(self._package.read(use.place.part))


def _without_roles(faces: IndexArray, ranges: list[Range], left_out: LeftOut, name: str) -> IndexArray:
    """The triangles that are in no range with a role."""
    kept = np.ones(len(faces), dtype=np.bool_)
    for each in ranges:
        block = kept[max(each.first, 0) : max(each.last + 1, 0)]
        if each.role is not None and block.any():
            left_out.add(of_role(each.role), each.name or name, int(block.sum()))
            block[:] = False
    return faces[kept]
