"""Reads a mesh file and converts it to millimetres.

trimesh parses the formats. This module adds the checks that its readers do not make: truncated ASCII
files, zip bombs, units and coordinate range. Its errors name the file and the remedy.
"""

import hashlib
import io
import re
import struct
import warnings
import zipfile
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import trimesh

from pipeline.core.errors import (
    CoordinateOutOfRange,
    IndexOutOfRange,
    MeshTooLarge,
    NoSurface,
    PipelineError,
    TruncatedFile,
    UnitUnknown,
    UnreadableFile,
)
from pipeline.core.formats import HEAD_BYTES, STL_FACE_BYTES, STL_HEADER_BYTES, Format, detect_format
from pipeline.core.mesh import FloatArray, IndexArray, Mesh
from pipeline.core.mesh_file import MeshFile
from pipeline.core.settings import LoadSettings, Unit

MM_PER_UNIT = {"mm": 1.0, "cm": 10.0, "m": 1000.0, "inch": 25.4}
#: Max absolute coordinate in mm (100 km). Beyond it, squares overflow the single precision of ray casting
#: and Poisson reconstruction. Derived.
MAX_COORDINATE_MM = 1e8

# What 3MF files may declare (core specification, section 3.4) in trimesh's spelling, and glTF's metre.
_DECLARED = {
    "micron": ("micron", 0.001),
    "millimeter": ("mm", 1.0),
    "centimeter": ("cm", 10.0),
    "inch": ("inch", 25.4),
    "foot": ("foot", 304.8),
    "feet": ("foot", 304.8),
    "meter": ("m", 1000.0),
}


@dataclass(frozen=True, slots=True)
class Loaded:
    """mesh : in mm, file frame; unit, mm_per_unit : unit of the file's numbers; sha256 : of the file's
    bytes.
    """

    mesh: Mesh
    format: Format
    unit: str
    mm_per_unit: float
    sha256: str


def load(source: MeshFile, name: str, settings: LoadSettings, *, needs_surface: bool) -> Loaded:
    """Read `source`; errors call it `name` (design, scan, mesh).

    Raises
    ------
    EmptyFile, UnknownFormat, TruncatedFile, UnreadableFile, MeshTooLarge, NotFinite, CoordinateOutOfRange,
    IndexOutOfRange, NoSurface (points where `needs_surface`), UnitUnknown
    """
    data = _read(source.path, name)
    kind = detect_format(data[:HEAD_BYTES], len(data), source.filename or source.path.name, mesh=name)
    try:
        _check_announced_size(data, kind, settings)
        vertices, faces, declared = _parse(data, kind)
        if len(faces) > settings.max_faces or len(vertices) > settings.max_points:
            raise MeshTooLarge(
                f"{len(faces)} triangles and {len(vertices)} vertices; the limits are "
                f"{settings.max_faces} and {settings.max_points}"
            )
        unit, mm_per_unit = _unit(source.unit, declared)
        mesh = Mesh(vertices * mm_per_unit, faces.astype(np.int32))
        _check_coordinates(mesh)
    except PipelineError as error:
        raise type(error)(error.reason, mesh=name, remedy=error.remedy) from error
    if mesh.is_cloud and needs_surface:
        raise NoSurface(f"the {kind} has {len(mesh.vertices)} points and no triangles", mesh=name)
    return Loaded(mesh, kind, unit, mm_per_unit, hashlib.sha256(data).hexdigest())


def _check_coordinates(mesh: Mesh) -> None:
    """Raise CoordinateOutOfRange for a vertex beyond `MAX_COORDINATE_MM`: such a number is damaged."""
    far = np.flatnonzero(np.abs(mesh.vertices).max(axis=1, initial=0.0) > MAX_COORDINATE_MM)
    if far.size:
        place = ", ".join(f"{x:.3g}" for x in mesh.vertices[far[0]])
        raise CoordinateOutOfRange(
            f"{far.size} of {len(mesh.vertices)} vertices lie more than {MAX_COORDINATE_MM:.0e} mm "
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


def _unit(requested: Unit, declared: str | None) -> tuple[str, float]:
    """The unit requested by the user; `auto` selects the declared unit of the file, or mm."""
    if requested != "auto":
        return requested, MM_PER_UNIT[requested]
    if declared is None:
        return "mm", 1.0
    if declared not in _DECLARED:
        raise UnitUnknown(f"the file declares the unit {declared!r}")
    return _DECLARED[declared]


def _check_announced_size(data: bytes, kind: Format, settings: LoadSettings) -> None:
    """Reject a file that is too large before parsing: by the header of a binary STL or the directory of a
    3MF.
    """
    if kind is Format.STL and not _is_ascii_stl(data):
        (announced,) = struct.unpack("<I", data[80:84])
        if announced > settings.max_faces:
            raise MeshTooLarge(f"{announced} triangles; the limit is {settings.max_faces}")
    if kind is Format.THREE_MF:
        try:
            with zipfile.ZipFile(io.BytesIO(data)) as archive:
                unpacked = sum(entry.file_size for entry in archive.infolist())
        except (zipfile.BadZipFile, OSError, ValueError) as error:
            raise UnreadableFile("the 3MF is not a complete zip archive") from error
        if unpacked > settings.max_archive_expansion * len(data):
            raise MeshTooLarge(
                f"the 3MF of {len(data)} bytes unpacks to {unpacked} bytes; "
                f"the limit is {settings.max_archive_expansion} times its size",
                remedy="if this is a real part, export it as binary STL",
            )


def _parse(data: bytes, kind: Format) -> tuple[FloatArray, IndexArray, str | None]:
    """Vertices, faces and the declared unit, by trimesh. Exceptions of its readers become a PipelineError."""
    if kind is Format.XYZ:
        return _parse_xyz(data), np.zeros((0, 3), dtype=np.int64), None
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            scene = trimesh.load_scene(io.BytesIO(data), file_type=kind.value, process=False)
            parts = scene.dump(concatenate=False)
    except MemoryError:
        raise
    except Exception as error:
        # The readers of trimesh raise many types of exception (KeyError, struct.error, those of lxml,
        # ...).
        text = str(error).lower()
        if isinstance(error, IndexError) or "index outside the range" in text:
            raise IndexOutOfRange(f"a face of the {kind} refers to a vertex that does not exist") from error
        if "length" in text or "unexpected end" in text or "truncated" in text:
            raise TruncatedFile(f"the {kind} ends before what its header announces") from error
        raise UnreadableFile(
            f"the {kind} could not be parsed: the file is damaged or has another format"
        ) from error
    meshes = [part for part in parts if isinstance(part, trimesh.Trimesh)]
    clouds = [part for part in parts if isinstance(part, trimesh.PointCloud)]
    vertices, faces = _concatenate(meshes or clouds)
    if kind in _COMPLETENESS:
        _COMPLETENESS[kind](data, len(vertices), len(faces))
    if len(vertices) == 0:
        raise UnreadableFile(f"the {kind} has no triangles and no points")
    declared = "meter" if kind is Format.GLB else scene.units if kind is Format.THREE_MF else None
    return vertices, faces, declared


def _concatenate(parts: list[trimesh.Trimesh] | list[trimesh.PointCloud]) -> tuple[FloatArray, IndexArray]:
    vertices: list[FloatArray] = [np.zeros((0, 3))]
    faces = [np.zeros((0, 3), dtype=np.int64)]
    count = 0
    for part in parts:
        points = np.asarray(part.vertices, dtype=np.float64).reshape(-1, 3)
        triangles = np.asarray(getattr(part, "faces", faces[0]), dtype=np.int64).reshape(-1, 3)
        if triangles.size and (triangles.min() < 0 or triangles.max() >= len(points)):
            wrong = triangles[(triangles < 0) | (triangles >= len(points))][0]
            raise IndexOutOfRange(
                f"a triangle refers to vertex {wrong}, but the mesh has {len(points)} vertices"
            )
        vertices.append(points)
        faces.append(triangles + count)
        count += len(points)
    return np.concatenate(vertices), np.concatenate(faces)


def _parse_xyz(data: bytes) -> FloatArray:
    text = re.sub(rb"[,;]", b" ", data).decode("utf-8", errors="replace")
    first = text.lstrip("\ufeff").split("\n", 1)[0].split("#")[0].split()
    try:
        [float(word) for word in first]
        header_lines = 0
    except ValueError:
        header_lines = 1
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # "input contained no data": reported below
            points = np.loadtxt(
                io.StringIO(text), comments=["#", "//"], usecols=(0, 1, 2), skiprows=header_lines, ndmin=2
            )
    except ValueError as error:
        raise UnreadableFile(
            "a line of the XYZ file is not three numbers",
            remedy="write one point on each line: x y z; further columns are ignored",
        ) from error
    if len(points) == 0:
        raise UnreadableFile("the XYZ file has no points")
    return points


def _is_ascii_stl(data: bytes) -> bool:
    announced = int.from_bytes(data[80:84], "little") if len(data) >= STL_HEADER_BYTES else -1
    return (
        len(data) != STL_HEADER_BYTES + STL_FACE_BYTES * announced and data.lstrip()[:5].lower() == b"solid"
    )


def _check_stl(data: bytes, n_vertices: int, n_faces: int) -> None:
    if _is_ascii_stl(data):
        tail = data[-4096:].lower()
        if b"endsolid" not in tail and data.lower().count(b"endfacet") != data.lower().count(b"facet normal"):
            raise TruncatedFile("the ASCII STL ends inside a facet")


def _check_ply(data: bytes, n_vertices: int, n_faces: int) -> None:
    header = data[: data.find(b"end_header")]
    for element, count in ((rb"vertex", n_vertices), (rb"face", n_faces)):
        announced = re.search(rb"element\s+" + element + rb"\s+(\d+)", header)
        if announced and count < int(announced[1]):
            raise TruncatedFile(
                f"the PLY announces {int(announced[1])} {element.decode()} rows and has {count}"
            )


def _check_off(data: bytes, n_vertices: int, n_faces: int) -> None:
    body = re.sub(rb"#[^\n]*", b"", data[:HEAD_BYTES])
    counts = re.match(rb"\s*\w*OFF\s+(\d+)\s+(\d+)", body)
    if counts and (n_vertices < int(counts[1]) or n_faces < int(counts[2])):
        raise TruncatedFile(
            f"the OFF announces {int(counts[1])} vertices and {int(counts[2])} faces, "
            f"and has {n_vertices} and {n_faces}"
        )


_COMPLETENESS: dict[Format, Callable[[bytes, int, int], None]] = {
    Format.STL: _check_stl,
    Format.PLY: _check_ply,
    Format.OFF: _check_off,
}
