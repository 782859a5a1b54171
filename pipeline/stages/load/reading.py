"""Reads a mesh file: its format, its bodies in millimetres, and checks of what every format can get wrong.
Errors name the file and the remedy.
"""

import hashlib
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from pipeline.core.brep_faces import BrepFaces
from pipeline.core.brep_faces import joined as joined_brep_faces
from pipeline.core.errors import (
    ColumnsUnfit,
    CoordinateOutOfRange,
    MeshTooLarge,
    NoSurface,
    PipelineError,
    UnreadableFile,
)
from pipeline.core.formats import HEAD_BYTES, Format, detect_format
from pipeline.core.mesh import FloatArray, IndexArray, IntArray, Mesh, frozen
from pipeline.core.mesh_file import MeshFile
from pipeline.core.results import Note
from pipeline.core.settings import LoadSettings, Unit
from pipeline.core.stations import Stations
from pipeline.stages.load.amf import read_amf
from pipeline.stages.load.contents import Contents, Reader, joined, used_bodies
from pipeline.stages.load.e57 import read_e57
from pipeline.stages.load.gltf import read_glb
from pipeline.stages.load.las import read_las
from pipeline.stages.load.las_unit import ASSUMED_UNIT
from pipeline.stages.load.obj import read_obj
from pipeline.stages.load.off import read_off
from pipeline.stages.load.parts import choose_part
from pipeline.stages.load.ply import read_ply
from pipeline.stages.load.point_text import read_point_text
from pipeline.stages.load.step import read_step
from pipeline.stages.load.stl import read_stl
from pipeline.stages.load.three_mf import read_three_mf
from pipeline.stages.load.units import unit_of
from pipeline.stages.load.vtp import read_vtp
from pipeline.stages.load.zip_archive import format_of_archive

READERS: dict[Format, Reader] = {
    Format.STL: read_stl,
    Format.PLY: read_ply,
    Format.OBJ: read_obj,
    Format.OFF: read_off,
    Format.THREE_MF: read_three_mf,
    Format.GLB: read_glb,
    Format.XYZ: read_point_text,
    Format.STEP: read_step,
    Format.LAS: read_las,
    Format.E57: read_e57,
    Format.VTP: read_vtp,
    Format.AMF: read_amf,
}
#: Max absolute coordinate in mm (100 km). Beyond it, squares overflow the single precision of ray casting
#: and Poisson reconstruction. Derived.
MAX_COORDINATE_MM = 1e8


@dataclass(frozen=True, slots=True)
class Loaded:
    """mesh : in mm, file frame; unit, mm_per_unit : unit of the file's numbers; sha256 : of the file's
    bytes; notes : what of the file is not used; body_of_face : (m,) int32 body of the file that each face is
    of, None where there is one; stations : where the scanner stood, frame of the file, None where it does not
    say; part, columns : of the file that was asked for, as `MeshFile` has them; brep : faces of the CAD
    model, None where the file has none
    """

    mesh: Mesh
    format: Format
    unit: str
    mm_per_unit: float
    sha256: str
    notes: tuple[Note, ...] = ()
    body_of_face: IntArray | None = None
    stations: Stations | None = None
    part: str | None = None
    columns: str | None = None
    brep: BrepFaces | None = None


def load(source: MeshFile, name: str, settings: LoadSettings, *, needs_surface: bool) -> Loaded:
    """Read `source`; errors call it `name` (design, scan, mesh).

    Raises
    ------
    EmptyFile, UnknownFormat, TruncatedFile, UnreadableFile, MeshTooLarge, NotFinite, CoordinateOutOfRange,
    IndexOutOfRange, NoSurface (points where `needs_surface`), UnitUnknown, PartNotFound, ColumnsUnfit
    """
    data = _read(source.path, name)
    kind = detect_format(data[:HEAD_BYTES], len(data), source.filename or source.path.name, mesh=name)
    kind = format_of_archive(data, kind)
    try:
        contents = _contents(kind, data, source, settings, is_design=name == "design")
        vertices, faces = joined(contents)
        if len(vertices) == 0:
            raise UnreadableFile(f"the {kind} has no triangles and no points")
        if not settings.allows(len(vertices), len(faces)):
            raise MeshTooLarge(
                f"{len(faces)} triangles and {len(vertices)} vertices; the limits are "
                f"{settings.max_faces} and {settings.max_points}"
            )
        unit, mm_per_unit = unit_of(source.unit, contents.unit)
        mesh = _in_mm(vertices, faces, mm_per_unit)
        _check_coordinates(mesh)
    except PipelineError as error:
        raise type(error)(error.reason, mesh=name, remedy=error.remedy) from error
    if mesh.is_cloud and needs_surface:
        raise NoSurface(f"the {kind} has {len(mesh.vertices)} points and no triangles", mesh=name)
    return Loaded(
        mesh,
        kind,
        unit,
        mm_per_unit,
        hashlib.sha256(data).hexdigest(),
        _notes(contents, source.unit),
        _body_of_face(contents),
        _stations(contents, mesh, mm_per_unit),
        source.part,
        source.columns,
        joined_brep_faces([(body.name, len(body.faces), body.brep) for body in used_bodies(contents)]),
    )


def _body_of_face(contents: Contents) -> IntArray | None:
    counts = [len(body.faces) for body in used_bodies(contents)]
    return np.repeat(np.arange(len(counts), dtype=np.int32), counts) if len(counts) > 1 else None


def _stations(contents: Contents, mesh: Mesh, mm_per_unit: float) -> Stations | None:
    bodies = used_bodies(contents)
    known = [at for at, body in enumerate(bodies) if body.scanner is not None]
    positions = [body.scanner * mm_per_unit for body in bodies if body.scanner is not None]
    if not positions:
        return None
    station_of_body = np.full(len(bodies), -1, dtype=np.int32)
    station_of_body[known] = np.arange(len(known), dtype=np.int32)
    of_vertex = np.repeat(station_of_body, [len(body.vertices) for body in bodies])
    stations = Stations.of_points(mesh.vertices, np.array(positions), of_vertex)
    return stations if stations.any else None


def _contents(
    kind: Format, data: bytes, source: MeshFile, settings: LoadSettings, *, is_design: bool
) -> Contents:
    """What is in the file, with the columns and the part that `source` states."""
    if kind is Format.XYZ:
        return read_point_text(data, settings, source.columns)
    if source.columns is not None:
        raise ColumnsUnfit(f"options.columns is for texts of points, and the file is {kind.upper()}")
    contents = READERS[kind](data, settings)
    has_faces = any(len(body.faces) for body in contents.bodies)
    if not has_faces and source.part is None:
        return contents
    return choose_part(contents, source.part, is_design=is_design)


def _in_mm(vertices: FloatArray, faces: IndexArray | IntArray, mm_per_unit: float) -> Mesh:
    """The mesh, whose arrays are those of the reader: a copy of a large file takes seconds and its memory."""
    if mm_per_unit != 1.0:
        vertices = vertices * mm_per_unit
    return Mesh(frozen(vertices), frozen(faces.astype(np.int32, copy=False)))


def _notes(contents: Contents, requested: Unit) -> tuple[Note, ...]:
    """Without the note of an assumed unit, where the user says the unit."""
    return tuple(note for note in contents.notes if requested == "auto" or note.code != ASSUMED_UNIT)


def _check_coordinates(mesh: Mesh) -> None:
    """Raise CoordinateOutOfRange for a vertex beyond `MAX_COORDINATE_MM`: such a number is damaged."""
    if (
        mesh.vertices.max(initial=0.0) <= MAX_COORDINATE_MM
        and mesh.vertices.min(initial=0.0) >= -MAX_COORDINATE_MM
    ):
        return
    far = np.flatnonzero(np.abs(mesh.vertices).max(axis=1, initial=0.0) > MAX_COORDINATE_MM)
    if far.size:
        place = ", ".join(f"{x:.3g}" for x in mesh.vertices[far[0]])
        raise CoordinateOutOfRange(
            f"{far.size} of {len(mesh.vertices)} vertices lie more than {MAX_COORDINATE_MM:,.0f} mm "
            "from the origin, the first "
            f"at ({place}) mm"
        )


def _read(path: Path, name: str) -> bytes:
    try:
        return path.read_bytes()
    except OSError as error:
        raise UnreadableFile(
            f"{path.name} cannot be read ({error.strerror})", mesh=name, remedy="check the path"
        ) from error
