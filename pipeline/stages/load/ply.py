"""PLY, ASCII and binary: polygons, triangle strips, range grids and clouds of points.

Colours, normals, confidences and texture coordinates are not used.
"""

import re
from collections.abc import Mapping

import numpy as np

from pipeline.core.errors import MeshTooLarge, NotFinite, UnreadableFile
from pipeline.core.formats import as_utf8
from pipeline.core.mesh import BoolArray, FloatArray, IndexArray
from pipeline.core.results import Note
from pipeline.core.settings import LoadSettings
from pipeline.stages.load.contents import Body, Contents
from pipeline.stages.load.ply_ascii import ascii_rows
from pipeline.stages.load.ply_binary import binary_rows
from pipeline.stages.load.ply_columns import Rows
from pipeline.stages.load.ply_header import COORDINATES, Element, Header, Property, read_header
from pipeline.stages.load.ply_surface import grid_triangles, polygon_triangles, strip_triangles

#: Names of the list with the corners of a face: of the writers since 1994, and of Turk's own.
CORNERS = ("vertex_indices", "vertex_index")
#: Properties that say that a point is the centre of a Gaussian splat (Kerbl et al. 2023, reference code).
SPLAT = ("f_dc_0", "opacity", "scale_0", "rot_0")
SURFACES = ("face", "tristrips", "range_grid")


def read_ply(data: bytes, settings: LoadSettings) -> Contents:
    """The triangles or points of a PLY, coordinates as written; what follows the last element is ignored.

    Notes: `points_without_position`, `range_grid`, `gaussian_splats`, `faces_without_area`, `decimal_comma`,
    `other_elements`.

    Raises
    ------
    TruncatedFile, UnreadableFile, IndexOutOfRange, MeshTooLarge, NotFinite (no point has a position)
        With line or byte, element and row.
    """
    data = as_utf8(data)
    if not data.startswith(b"ply"):
        data = data.lstrip()
    header = read_header(data)
    vertex, position = _positions(header)
    _check_sizes(header, len(data) - header.size, settings)
    rows: Mapping[str, Rows]
    notes: list[Note] = []
    if header.is_ascii:
        rows, notes = ascii_rows(data, header)
    else:
        rows = binary_rows(data, header)
    vertices = rows[vertex.name].scalars(position)
    faces, of_faces = _faces(header, rows, vertices, settings)
    vertices, faces, of_points = _with_positions(vertices, faces)
    notes += of_faces + of_points + _splats(vertex) + _others(header)
    return Contents((Body(vertices, faces),), notes=tuple(notes))


def _positions(header: Header) -> tuple[Element, list[Property]]:
    """The vertex element and its x, y and z."""
    vertex = header.find("vertex")
    if vertex is None:
        names = ", ".join(each.name for each in header.elements[:20]) or "none"
        raise UnreadableFile(f"the PLY has no element vertex; its elements: {names}")
    found = [vertex.find(name) for name in COORDINATES]
    position = [each for each in found if each is not None and each.count is None]
    if len(position) < len(COORDINATES):
        raise UnreadableFile(
            f"the vertices of the PLY have no x, y and z; their properties: {vertex.listed}",
            remedy="export the file with the coordinates of each vertex as x, y and z",
        )
    return vertex, position


def _check_sizes(header: Header, left: int, settings: LoadSettings) -> None:
    """Refuse what is too large, where the file is long enough to have it; else it is truncated."""
    face = header.find("face")
    n_faces = 0 if face is None else face.rows
    limits = {"vertex": (settings.max_points, "vertices"), "face": (settings.max_faces, "faces")}
    for element in header.elements:
        limit, what = limits.get(element.name.lower(), (element.rows, ""))
        if what == "vertices" and settings.allows(element.rows, n_faces):
            continue
        widths = [2 if header.is_ascii else (each.count or each.item).itemsize for each in element.properties]
        if element.rows > limit and element.rows * sum(widths) <= left + 1:
            raise MeshTooLarge(f"{element.rows} {what}; the limit is {limit}")


def _faces(
    header: Header, rows: Mapping[str, Rows], vertices: FloatArray, settings: LoadSettings
) -> tuple[IndexArray, list[Note]]:
    """(m, 3) triangles of all elements that have some."""
    found: list[IndexArray] = [np.zeros((0, 3), dtype=np.int64)]
    notes: list[Note] = []
    for name in SURFACES:
        element = header.find(name)
        if element is None or element.rows == 0 or (name == "range_grid" and any(map(len, found))):
            continue
        corners = element.find(*CORNERS)
        if corners is None or corners.count is None:
            raise UnreadableFile(
                f"the element {element.name} of the PLY has no list vertex_indices or vertex_index; "
                f"its properties: {element.listed}"
            )
        column = rows[element.name].lists(corners)
        if name == "face":
            triangles, more = polygon_triangles(vertices, column, settings)
            notes += more
        elif name == "tristrips":
            triangles = strip_triangles(len(vertices), column, settings)
        else:
            size = _grid_size(header)
            if size is None or size[0] * size[1] != element.rows:
                notes.append(_grid_without_size(element, size))
                continue
            triangles, note = grid_triangles(vertices, column, size, settings)
            notes.append(note)
        found.append(triangles)
    return found[-1] if len(found) == 2 else np.concatenate(found), notes


def _grid_size(header: Header) -> tuple[int, int] | None:
    """Columns and rows of a range grid, from its `obj_info`."""
    info = {words[0]: words[1] for words in header.info if len(words) > 1}
    size = [info.get(name, "") for name in ("num_cols", "num_rows")]
    return (int(size[0]), int(size[1])) if all(re.fullmatch(r"[0-9]{1,9}", each) for each in size) else None


def _grid_without_size(element: Element, size: tuple[int, int] | None) -> Note:
    told = (
        f"its size is given as {size[0]} x {size[1]}" if size else "its obj_info has no num_cols and num_rows"
    )
    return Note(
        code="range_grid",
        detail=f"the PLY: a range grid has {element.rows} cells, and {told}, so its points are read without "
        "triangles, as a cloud",
    )


def _with_positions(vertices: FloatArray, faces: IndexArray) -> tuple[FloatArray, IndexArray, list[Note]]:
    """Without the points that are NaN or infinite and that no triangle uses: organised clouds have them where
    the scanner saw nothing. Those that a triangle uses stay, and the mesh reports them.
    """
    if np.isfinite(vertices.max(initial=0.0)) and np.isfinite(vertices.min(initial=0.0)):
        return vertices, faces, []
    kept: BoolArray = np.asarray(np.isfinite(vertices).all(axis=1))
    kept[faces.ravel()] = True
    lost = len(vertices) - int(kept.sum())
    if lost == 0:
        return vertices, faces, []
    if lost == len(vertices):
        raise NotFinite(f"all {lost} points are NaN or infinite")
    number = np.cumsum(kept) - 1
    detail = (
        f"the PLY: {lost} of {len(vertices)} points are NaN or infinite, where the scanner saw nothing; "
        "they are left out, and nothing else changes"
    )
    return vertices[kept], number[faces], [Note(code="points_without_position", detail=detail)]


def _splats(vertex: Element) -> list[Note]:
    if any(vertex.find(name) is None for name in SPLAT):
        return []
    detail = (
        f"the PLY holds {vertex.rows} Gaussian splats; their centres are read as points, without size and "
        "opacity. Centres lie beside the surface, so deviations are less exact than those of a scan"
    )
    return [Note(code="gaussian_splats", detail=detail)]


def _others(header: Header) -> list[Note]:
    others = [
        f"{each.rows} {each.name}"
        for each in header.elements
        if each.rows and each.name.lower() not in ("vertex", *SURFACES)
    ]
    if not others:
        return []
    more = f" and {len(others) - 5} more" if len(others) > 5 else ""
    detail = f"the PLY also has rows that are no surface: {', '.join(others[:5])}{more}; they are not used"
    return [Note(code="other_elements", detail=detail)]
