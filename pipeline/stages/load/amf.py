"""AMF (ISO/ASTM 52915): the volumes that are the part, placed by their constellations; as XML or zipped.

Materials, colours and textures are not used. Triangles that the file says are curved are read flat.
"""

from dataclasses import dataclass, field

import numpy as np
from scipy.spatial.transform import Rotation

from pipeline.core.errors import IndexOutOfRange, MeshTooLarge, UnreadableFile
from pipeline.core.formats import ZIP
from pipeline.core.mesh import FloatArray
from pipeline.core.results import Note
from pipeline.core.settings import LoadSettings
from pipeline.stages.load.amf_xml import Amf, AmfObject, Instance, Volume, read_xml
from pipeline.stages.load.contents import Body, Contents, FilePart
from pipeline.stages.load.three_mf_left_out import listed
from pipeline.stages.load.three_mf_roles import NOT_PRINTED
from pipeline.stages.load.zip_archive import Archive

#: Constellations within constellations.
MAX_DEPTH = 32
#: Instances that are placed, of all constellations.
MAX_INSTANCES = 10_000


def read_amf(data: bytes, settings: LoadSettings) -> Contents:
    """One body for each volume of each placed object, in the unit of the file.

    Notes: `left_out_of_amf`, `several_parts`, `curved_triangles`.

    Raises
    ------
    TruncatedFile, UnreadableFile, IndexOutOfRange, MeshTooLarge
        With the line or the object.
    """
    amf = read_xml(_unzipped(data, settings).lstrip(), settings)
    builder = _Builder(amf, settings)
    with np.errstate(over="ignore", invalid="ignore"):  # what overflows is refused as not finite
        builder.build()
    if not builder.bodies:
        found = ", ".join(_phrase(role, names) for role, names in builder.left_out.items())
        raise UnreadableFile(
            f"the AMF has no triangles{f' that are the part, only {found}' if found else ''}",
            remedy="export the part as a solid mesh, not as support or modifier",
        )
    return Contents(tuple(builder.bodies), amf.unit, tuple(builder.notes()))


def _unzipped(data: bytes, settings: LoadSettings) -> bytes:
    if not data.startswith(ZIP):
        return data
    archive = Archive(data, settings, "AMF")
    names = [
        name for name in archive.names if name.lower().endswith(".amf") and not name.startswith("__MACOSX/")
    ]
    if len(names) != 1:
        raise UnreadableFile(
            f"the zip archive has {len(names)} AMF files ({listed(names)})"
            if names
            else "the zip archive has no AMF file",
            remedy="send one AMF file",
        )
    return archive.read(names[0])


@dataclass(slots=True, eq=False)
class _Builder:
    amf: Amf
    settings: LoadSettings
    bodies: list[Body] = field(default_factory=list)
    left_out: dict[str, list[str]] = field(default_factory=dict)
    placed: list[str] = field(default_factory=list)
    n_instances: int = 0
    n_vertices: int = 0
    n_faces: int = 0

    def build(self) -> None:
        """Place every constellation that no other one contains, and every object that none contains."""
        used = {each.target for group in self.amf.constellations.values() for each in group}
        roots = [name for name in self.amf.constellations if name not in used]
        if self.amf.constellations and not roots:
            raise UnreadableFile("the constellations of the AMF contain each other in a circle")
        for name in roots:
            self._constellation(name, np.eye(4), 0)
        for name, each in self.amf.objects.items():
            if name not in used:
                self._object(name, each, np.eye(4))

    def _constellation(self, name: str, T_file_group: FloatArray, depth: int) -> None:
        if depth > MAX_DEPTH:
            raise UnreadableFile(
                f"constellation {name[:40]} of the AMF lies within more than {MAX_DEPTH} others"
            )
        for instance in self.amf.constellations[name]:
            self.n_instances += 1
            if self.n_instances > MAX_INSTANCES:
                raise MeshTooLarge(f"the AMF places more than {MAX_INSTANCES} instances")
            if instance.values.get("printable", 1.0) == 0:
                self.left_out.setdefault("instance marked as not printable", []).append(instance.target)
                continue
            T_file_instance = T_file_group @ self._transform(instance)
            if instance.target in self.amf.objects:
                self._object(instance.target, self.amf.objects[instance.target], T_file_instance)
            elif instance.target in self.amf.constellations:
                self._constellation(instance.target, T_file_instance, depth + 1)
            else:
                raise UnreadableFile(
                    f"the AMF, line {instance.line}: an instance refers to object {instance.target[:40]!r}, "
                    "which the file does not have"
                )

    def _transform(self, instance: Instance) -> FloatArray:
        """(4, 4): scaled, turned about x, y and z in this order, then moved (clause 10)."""
        values = instance.values
        angles = np.array([values.get(f"r{axis}", 0.0) for axis in "xyz"])
        if not self._is_of_slic3r:
            angles = np.radians(angles)
        scale = np.array(
            [
                values.get("scale", 1.0)
                * values.get(f"scale{axis}", 1.0)
                * (values.get(f"mirror{axis}", 1.0) or 1.0)
                for axis in "xyz"
            ]
        )
        offset = np.array([values.get(f"delta{axis}", 0.0) for axis in "xyz"])
        if not (np.isfinite([*angles, *scale, *offset]).all() and (scale != 0).all()):
            raise UnreadableFile(f"the AMF, line {instance.line}: the transform of an instance is singular")
        transform = np.eye(4)
        transform[:3, :3] = Rotation.from_euler("xyz", angles).as_matrix() * scale
        transform[:3, 3] = offset
        return transform

    @property
    def _is_of_slic3r(self) -> bool:
        """Slic3r and PrusaSlicer write angles in radians; the standard has degrees."""
        metadata = self.amf.metadata
        return "slic3rpe_amf_version" in metadata or "slic3r" in metadata.get("cad", "").lower()

    def _object(self, name: str, each: AmfObject, T_file_object: FloatArray) -> None:
        vertices = np.frombuffer(each.coordinates).reshape(-1, 3)
        moved = vertices @ T_file_object[:3, :3].T + T_file_object[:3, 3]
        mirrored = np.linalg.det(T_file_object[:3, :3]) < 0
        title = each.metadata.get("name") or f"object {name}"
        before = len(self.bodies)
        part = FilePart(len(self.placed), title)
        for volume in each.volumes:
            self._volume(volume, moved, part, bool(mirrored))
        if len(self.bodies) > before:
            self.placed.append(title)

    def _volume(self, volume: Volume, vertices: FloatArray, part: FilePart, mirrored: bool) -> None:
        name = volume.metadata.get("name") or part.name
        role = _role(volume)
        if role is not None:
            self.left_out.setdefault(role, []).append(name)
            return
        faces = np.frombuffer(volume.triangles, dtype=np.int64).reshape(-1, 3)
        if not len(faces):
            return
        if faces.max() >= len(vertices):
            first = int((faces >= len(vertices)).any(axis=1).argmax())
            raise IndexOutOfRange(
                f"triangle {first} (the first is 0) of {name[:40]} in the AMF refers to vertex "
                f"{faces[first].max()}, but there are {len(vertices)}, counted from 0"
            )
        used, compact = np.unique(faces, return_inverse=True)
        faces = compact.reshape(-1, 3)
        self.n_vertices, self.n_faces = self.n_vertices + len(used), self.n_faces + len(faces)
        if not self.settings.allows(self.n_vertices, self.n_faces):
            raise MeshTooLarge(
                f"{self.n_faces} triangles and {self.n_vertices} vertices; the limits are "
                f"{self.settings.max_faces} and {self.settings.max_points}"
            )
        self.bodies.append(Body(vertices[used], faces[:, ::-1] if mirrored else faces, name, part))

    def notes(self) -> list[Note]:
        """What was left out, how many parts there are, and curved triangles."""
        notes = []
        if len(self.placed) > 1:
            numbered = [f"{number} {name}" for number, name in enumerate(self.placed, start=1)]
            detail = (
                f"the AMF: {len(self.placed)} parts ({listed(numbered)}), and all of them are read as one "
                "part, where they are placed; for one of them, save it alone"
            )
            notes.append(Note(code="several_parts", detail=detail))
        for role, names in self.left_out.items():
            detail = f"the AMF: {_phrase(role, names)} left out: not part of the print"
            notes.append(Note(code="left_out_of_amf", detail=detail))
        n_curved = sum(each.n_curved for each in self.amf.objects.values())
        if n_curved:
            detail = (
                f"the AMF: {n_curved} edges and vertices say that triangles are curved; they were read flat, "
                "so the design lies inside of the surface that is meant: export it with finer, flat triangles"
            )
            notes.append(Note(code="curved_triangles", detail=detail))
        return notes


def _role(volume: Volume) -> str | None:
    """What a volume is, if not the part: of the standard (`type`), or of Slic3r and PrusaSlicer."""
    if volume.kind == "support":
        return "support"
    metadata = volume.metadata
    if metadata.get("slic3r.modifier") == "1":
        return "modifier"
    return NOT_PRINTED.get(metadata.get("slic3r.volume_type", "").lower())


def _phrase(role: str, names: list[str]) -> str:
    return f"{len(names)} {role}{'s' if len(names) > 1 else ''} ({listed(names)})"
