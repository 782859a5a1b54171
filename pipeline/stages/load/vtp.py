"""VTP (VTK XML PolyData): polygons and triangle strips as triangles, or points.

Colours, scalars and other data of points and cells are not used. VTP declares no unit.
Source: VTK file formats (Kitware), "XML file formats".
"""

from typing import Any

import numpy as np

from pipeline.core.errors import IndexOutOfRange, MeshTooLarge, UnreadableFile
from pipeline.core.mesh import FloatArray, IndexArray
from pipeline.core.results import Note
from pipeline.core.settings import LoadSettings
from pipeline.stages.load.contents import Body, Contents, FilePart
from pipeline.stages.load.polygons import triangulated
from pipeline.stages.load.vtp_arrays import Arrays
from pipeline.stages.load.vtp_xml import open_vtk

#: Pieces are how a program divided its work: one part.
WHOLE = FilePart(0, "")
#: Dimensions of a point.
DIMENSIONS = 3
#: Beyond it the area of a polygon overflows. Derived: the fourth root of the max of float64, rounded down.
MAX_OF_POLYGON = 1e75


def read_vtp(data: bytes, settings: LoadSettings) -> Contents:
    """One body for each piece; a cloud where no piece has triangles.

    Notes: `left_out_of_vtp`.

    Raises
    ------
    TruncatedFile, UnreadableFile, IndexOutOfRange, MeshTooLarge
        With the piece and the array.
    """
    file = open_vtk(data)
    arrays = Arrays(file, len(data), settings)
    bodies: list[Body] = []
    n_lines = n_narrow = n_vertices = n_faces = 0
    for number, piece in enumerate(file.pieces):
        where = f"piece {number}"
        points = _points(piece, arrays, where)
        triangles, narrow = _polygons(piece, arrays, points, where)
        strips = _strips(piece, arrays, len(points), where)
        faces = np.concatenate([triangles, strips])
        n_lines += _count(piece, "NumberOfLines")
        n_narrow += narrow
        n_vertices, n_faces = n_vertices + len(points), n_faces + len(faces)
        if not settings.allows(n_vertices, n_faces):
            raise MeshTooLarge(
                f"{n_faces} triangles and {n_vertices} vertices; the limits are "
                f"{settings.max_faces} and {settings.max_points}"
            )
        if len(points):
            bodies.append(Body(points, faces, part=WHOLE))
    with_faces = [body for body in bodies if len(body.faces)]
    if not bodies or (not with_faces and n_lines):
        raise UnreadableFile(
            f"the VTP has no triangles and no points, and {n_lines} lines"
            if n_lines
            else "the VTP has no triangles and no points",
            remedy="export the surface of the part as triangles",
        )
    notes = _notes(
        n_lines, n_narrow, sum(len(b.vertices) for b in bodies if not len(b.faces)) * bool(with_faces)
    )
    return Contents(tuple(with_faces or bodies), notes=notes)


def _notes(n_lines: int, n_narrow: int, n_points: int) -> tuple[Note, ...]:
    parts = [f"{n_lines} lines"] * (n_lines > 0)
    parts += [f"{n_narrow} polygons with fewer than 3 corners"] * (n_narrow > 0)
    parts += [f"{n_points} points of pieces without triangles"] * (n_points > 0)
    if not parts:
        return ()
    detail = f"the VTP: {', '.join(parts)} left out: no area, no effect"
    return (Note(code="left_out_of_vtp", detail=detail),)


def _count(piece: Any, name: str) -> int:
    text = piece.get(name) or "0"
    return int(text) if text.isdigit() else 0


def _points(piece: Any, arrays: Arrays, where: str) -> FloatArray:
    node = piece.find("Points/DataArray")
    if node is None:
        return np.zeros((0, DIMENSIONS))
    if (node.get("NumberOfComponents") or "3") != "3":
        raise UnreadableFile(
            f"the points of {where} of the VTP have {node.get('NumberOfComponents')[:9]} numbers"
        )
    with np.errstate(invalid="ignore"):  # a NaN of single precision may signal
        values = arrays.read(node, f"points of {where}").astype(np.float64)
    announced = piece.get("NumberOfPoints")
    n_points, remainder = divmod(len(values), DIMENSIONS)
    if remainder or (announced and announced.isdigit() and int(announced) != n_points):
        raise UnreadableFile(
            f"{where} of the VTP announces {str(announced)[:20]} points, and has {len(values)} coordinates"
        )
    return values.reshape(-1, DIMENSIONS)


def _cells(piece: Any, arrays: Arrays, kind: str, n_points: int, where: str) -> tuple[IndexArray, IndexArray]:
    """Corners of all cells of a kind, and how many each has."""
    nodes = {node.get("Name"): node for node in piece.findall(f"{kind}/DataArray")}
    if "connectivity" not in nodes or "offsets" not in nodes:
        if _count(piece, f"NumberOf{kind}"):
            raise UnreadableFile(f"{where} of the VTP has no connectivity and offsets of its {kind.lower()}")
        return np.zeros(0, dtype=np.int64), np.zeros(0, dtype=np.int64)
    corners, ends = (
        _integers(arrays, nodes[name], f"{kind.lower()} ({name}) of {where}")
        for name in ("connectivity", "offsets")
    )
    announced = piece.get(f"NumberOf{kind}")
    if announced and announced.isdigit() and int(announced) != len(ends):
        raise UnreadableFile(
            f"{where} of the VTP announces {announced[:20]} {kind.lower()}, and has {len(ends)}"
        )
    counts = np.diff(ends, prepend=0)
    if (counts < 0).any() or (len(ends) and ends[-1] != len(corners)) or (not len(ends) and len(corners)):
        raise UnreadableFile(
            f"the offsets of the {kind.lower()} of {where} of the VTP do not fit their corners"
        )
    outside = np.flatnonzero((corners < 0) | (corners >= n_points))
    if outside.size:
        cell = int(np.searchsorted(ends, outside[0], side="right"))
        raise IndexOutOfRange(
            f"{kind.lower()[:-1]} {cell} (the first is 0) of {where} of the VTP refers to point "
            f"{corners[outside[0]]}, but there are {n_points}, counted from 0"
        )
    return corners, counts


def _integers(arrays: Arrays, node: Any, where: str) -> IndexArray:
    values = arrays.read(node, where)
    if values.dtype.kind == "f":
        raise UnreadableFile(f"the {where} of the VTP are no integers")
    return values.astype(np.int64)


def _polygons(piece: Any, arrays: Arrays, points: FloatArray, where: str) -> tuple[IndexArray, int]:
    """(m, 3) triangles, and how many polygons have none."""
    corners, counts = _cells(piece, arrays, "Polys", len(points), where)
    if len(points) and len(corners) and not (np.abs(points[corners]) < MAX_OF_POLYGON).all():
        raise UnreadableFile(f"{where} of the VTP has polygons with corners that are not finite or too far")
    return triangulated(points, corners, counts), int((counts < DIMENSIONS).sum())


def _strips(piece: Any, arrays: Arrays, n_points: int, where: str) -> IndexArray:
    """(m, 3) triangles of strips: each corner with the two before it, every second one turned over."""
    corners, counts = _cells(piece, arrays, "Strips", n_points, where)
    within = np.arange(len(corners)) - np.repeat(np.cumsum(counts) - counts, counts)
    last = np.flatnonzero(within >= 2)
    turned = within[last] % 2 == 1
    a, b = corners[last - 2], corners[last - 1]
    triangles = np.stack([np.where(turned, b, a), np.where(turned, a, b), corners[last]], axis=1)
    i, j, k = triangles.T
    return np.asarray(triangles[(i != j) & (j != k) & (k != i)])  # a corner twice joins strips
