"""Wavefront OBJ: its polygons as triangles, or its points. Colours, normals, materials are not used."""

from collections import Counter

import numpy as np

from pipeline.core.errors import UnreadableFile
from pipeline.core.formats import Format
from pipeline.core.mesh import IndexArray
from pipeline.core.results import Note
from pipeline.core.settings import LoadSettings
from pipeline.kernels import topology
from pipeline.stages.load.contents import Body, Contents
from pipeline.stages.load.obj_lines import Statements, read_statements
from pipeline.stages.load.text_polygons import check_finite, check_size, triangles_of

#: Objects that become bodies of their own; with more, all are one body. Affects only names.
MAX_OBJECTS = 1000


def read_obj(data: bytes, settings: LoadSettings) -> Contents:
    """One body for each `o` with faces (without `o`, for each closed `g`), or one where these share vertices;
    without faces, the points.

    A body has the vertices that its faces use, in the order of the file. The number `w` of a vertex weighs
    curves only, and is not used.

    Notes: `left_out_of_obj`, `decimal_comma`.

    Raises
    ------
    UnreadableFile, IndexOutOfRange, NotFinite, MeshTooLarge
        With the line.
    """
    statements = read_statements(data, settings)
    faces = statements.faces
    check_size(len(statements.vertices), faces.counts, settings)
    notes = _notes(statements)
    if not (faces.counts >= 3).any():
        return Contents((_cloud(statements, notes),), notes=tuple(notes))
    used = np.zeros(len(statements.vertices), dtype=np.bool_)
    used[faces.corners[np.repeat(faces.counts >= 3, faces.counts)]] = True
    check_finite(statements.vertices, np.flatnonzero(used), statements.vertex_lines, Format.OBJ)
    if not used.all():
        notes.append(_left_out(int((~used).sum()), "vertex", "vertices", "that no face uses"))
    if points := len(statements.points.counts):
        notes.append(_left_out(points, "point statement (p)", "point statements (p)", "beside faces"))
    return Contents(tuple(_bodies(statements)), notes=tuple(notes))


def _bodies(statements: Statements) -> list[Body]:
    """Of the objects; where there are none, of the groups that are closed surfaces each, so that groups of
    faces of one part (by material, by CAD face) are one body.
    """
    faces = statements.faces
    part, names = _parts(statements.objects, len(faces.counts), by_name=False)
    bodies = _separate(statements, part, names)
    if bodies is None and not statements.objects:
        part, names = _parts(statements.groups, len(faces.counts), by_name=True)
        bodies = _separate(statements, part, names)
        if bodies is not None and not all(_is_closed(body) for body in bodies):
            bodies = None
    if bodies is not None:
        return bodies
    present = np.unique(part) if statements.objects else np.zeros(0, dtype=np.int64)
    return [_body(statements, faces.corners, faces.counts, names[present[0]] if len(present) == 1 else "")]


def _parts(statements: list[tuple[str, int]], n_faces: int, *, by_name: bool) -> tuple[IndexArray, list[str]]:
    """Part of each face (f,), and names of the parts. by_name : statements of one name are one part"""
    names = ["", *(name for name, _ in statements)]
    part = np.zeros(n_faces, dtype=np.int64)
    starts = [start for _, start in statements]
    np.add.at(part, [start for start in starts if start < n_faces], 1)
    part = np.cumsum(part)
    if by_name:
        number = {name: at for at, name in enumerate(dict.fromkeys(names))}
        return np.array([number[name] for name in names], dtype=np.int64)[part], list(number)
    return part, names


def _separate(statements: Statements, part: IndexArray, names: list[str]) -> list[Body] | None:
    """A body for each part; None where there is one, too many, or two that share vertices."""
    faces = statements.faces
    present = np.unique(part)
    if not 1 < len(present) <= MAX_OBJECTS:
        return None
    of_corner = np.repeat(part, faces.counts)
    corners = [faces.corners[of_corner == each] for each in present]
    used = [np.unique(each) for each in corners]
    if len(np.unique(np.concatenate(used))) != sum(map(len, used)):
        return None
    bodies = [
        _body(statements, each, faces.counts[part == k], names[k])
        for each, k in zip(corners, present, strict=True)
    ]
    return [body for body in bodies if len(body.faces)]


def _is_closed(body: Body) -> bool:
    """Whether each edge has two triangles."""
    return bool((topology.edges(body.faces.astype(np.int32)).count == 2).all())


def _body(statements: Statements, corners: IndexArray, counts: IndexArray, name: str) -> Body:
    """Faces with the vertices that they use."""
    whole = counts >= 3
    if not whole.all():
        corners, counts = corners[np.repeat(whole, counts)], counts[whole]
    n_vertices = len(statements.vertices)
    if len(corners) < n_vertices // 4:
        used, corners = np.unique(corners, return_inverse=True)
    else:
        is_used = np.zeros(n_vertices, dtype=np.bool_)
        is_used[corners] = True
        used, corners = np.flatnonzero(is_used), (np.cumsum(is_used) - 1)[corners]
    vertices = statements.vertices[used]
    return Body(vertices, triangles_of(vertices, corners, counts), name)


def _cloud(statements: Statements, notes: list[Note]) -> Body:
    """The points of a file without faces: those of its `p` statements, or all vertices."""
    vertices, points = statements.vertices, statements.points
    other = Counter({"f with fewer than 3 corners": len(statements.faces.counts), "l": statements.lines})
    other.update(statements.free_form)
    if +other and not points.counts.any():
        listed = ", ".join(f"{count} of {key}" for key, count in (+other).items())
        raise UnreadableFile(
            f"the {Format.OBJ} has no faces (f), but other elements that have no triangles ({listed})",
            remedy="export the surface as a mesh of triangles or polygons",
        )
    if not len(vertices):
        raise UnreadableFile(f"the {Format.OBJ} has no vertices (v)")
    chosen = np.unique(points.corners) if points.counts.any() else np.arange(len(vertices))
    check_finite(vertices, chosen, statements.vertex_lines, Format.OBJ)
    if len(chosen) < len(vertices):
        notes.append(_left_out(len(vertices) - len(chosen), "vertex", "vertices", "that no point (p) uses"))
    return Body.cloud(vertices[chosen])


def _notes(statements: Statements) -> list[Note]:
    short = int((statements.faces.counts < 3).sum())
    curves = sum(statements.free_form.values())
    unknown = sum(statements.unknown.values())
    notes = []
    if short:
        notes.append(_left_out(short, "face", "faces", "with fewer than 3 corners, which have no area"))
    if statements.lines:
        notes.append(_left_out(statements.lines, "line element (l)", "line elements (l)", "without area"))
    if curves:
        keys = ", ".join(statements.free_form)
        notes.append(
            _left_out(curves, f"curve or surface ({keys})", f"curves or surfaces ({keys})", "of free form")
        )
    if unknown:
        keys = ", ".join(list(statements.unknown)[:5])
        notes.append(_left_out(unknown, "statement", "statements", f"that OBJ does not have ({keys})"))
    if statements.decimal_comma:
        detail = (
            f"the {Format.OBJ}: the numbers of {statements.decimal_comma} vertices are written with a comma, "
            "which was read as a decimal point"
        )
        notes.append(Note(code="decimal_comma", detail=detail))
    return notes


def _left_out(count: int, one: str, many: str, which: str) -> Note:
    what, verb = (one, "is") if count == 1 else (many, "are")
    return Note(
        code="left_out_of_obj",
        detail=f"the {Format.OBJ}: {count} {what} {which} {verb} not part of the surface and "
        f"{'was' if count == 1 else 'were'} left out",
    )
