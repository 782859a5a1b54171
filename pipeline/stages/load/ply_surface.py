"""Triangles of a PLY: from polygons, from triangle strips and from the grid of a range scan."""

import numpy as np

from pipeline.core.errors import IndexOutOfRange, MeshTooLarge, UnreadableFile
from pipeline.core.mesh import BoolArray, FloatArray, IndexArray
from pipeline.core.results import Note
from pipeline.core.settings import LoadSettings
from pipeline.stages.load.ply_columns import ListColumn
from pipeline.stages.load.polygons import triangulated

#: Longest edge of a triangle of a range grid, over the median edge. Derived: a surface seen at the angle a to
#: its normal has edges of 1 / cos(a) times the spacing, so 5 keeps all that is seen at less than 78 degrees;
#: longer edges lead from an outline to what is behind it.
DEPTH_JUMP = 5.0


def polygon_triangles(
    vertices: FloatArray, faces: ListColumn, settings: LoadSettings
) -> tuple[IndexArray, list[Note]]:
    """(m, 3) triangles of polygons, in their order; a note of those with less than three corners."""
    corners, counts = indices(faces, "face"), faces.counts
    _check_number(int(np.maximum(counts - 2, 0).sum()), settings)
    _check_corners(corners, counts, len(vertices), "face")
    if (counts == 3).all():
        return corners.reshape(-1, 3), []
    finite = np.isfinite(vertices)
    with np.errstate(all="ignore"):  # what is not finite or too far away is reported for the mesh
        triangles = triangulated(
            vertices if finite.all() else np.where(finite, vertices, 0.0), corners, counts
        )
    narrow = int((counts < 3).sum())
    detail = f"the PLY: {narrow} of {len(counts)} faces have less than three corners; they have no area"
    return triangles, [Note(code="faces_without_area", detail=detail)] if narrow else []


def strip_triangles(n_vertices: int, strips: ListColumn, settings: LoadSettings) -> IndexArray:
    """(m, 3) triangles of strips: each corner with the two before it, every second one turned over.

    The index -1 (of an unsigned type, its largest) starts a new strip, as in the Stanford repository.
    Triangles with one corner twice join strips and are left out.
    """
    corners = indices(strips, "tristrips")
    largest = -1 if strips.items.dtype.kind != "u" else int(np.iinfo(strips.items.dtype).max)
    restart = (corners == -1) | (corners == largest)
    _check_number(len(corners), settings, about=True)
    row = np.repeat(np.arange(len(strips.counts)), strips.counts)
    places = np.arange(len(corners))
    begins = np.ones(len(corners), dtype=np.bool_)
    begins[1:] = restart[:-1] | (row[1:] != row[:-1])
    within = places - np.maximum.accumulate(np.where(begins, places, 0))
    outside = ~restart & ((corners < 0) | (corners >= n_vertices))
    if outside.any():
        first = int(outside.argmax())
        raise _outside("tristrips", int(row[first]), int(corners[first]), n_vertices)
    last = np.flatnonzero((within >= 2) & ~restart)
    turned = within[last] % 2 == 1
    a, b = corners[last - 2], corners[last - 1]
    triangles = np.stack([np.where(turned, b, a), np.where(turned, a, b), corners[last]], axis=1)
    i, j, k = triangles.T
    return np.asarray(triangles[(i != j) & (j != k) & (k != i)])


def grid_triangles(
    vertices: FloatArray, cells: ListColumn, size: tuple[int, int], settings: LoadSettings
) -> tuple[IndexArray, Note]:
    """(m, 3) triangles of a range grid of (columns, rows) cells, row after row, each with one point or none.

    Four neighbours with a point make two triangles at the shorter diagonal, three make one (trimesh2 of
    Rusinkiewicz, TriMesh_grid); a point at (0, 0, 0) or that is not finite is none. Triangles at a
    `DEPTH_JUMP` are left out, and counted in the note.
    """
    columns, rows = size
    if (cells.counts > 1).any():
        row = int((cells.counts > 1).argmax())
        raise UnreadableFile(
            f"row {row} of range_grid in the PLY has {cells.counts[row]} points, more than one"
        )
    points = indices(cells, "range_grid")
    _check_corners(points, cells.counts, len(vertices), "range_grid")
    grid = np.full(columns * rows, -1, dtype=np.int64)
    grid[cells.counts == 1] = points
    measured = np.isfinite(vertices).all(axis=1) & (vertices != 0.0).any(axis=1)
    grid[grid >= 0] = np.where(measured[grid[grid >= 0]], grid[grid >= 0], -1)
    _check_number(2 * int((grid >= 0).sum()), settings, about=True)
    cell = grid.reshape(rows, columns)
    ll, lr, ul, ur = (
        corner.ravel() for corner in (cell[:-1, :-1], cell[:-1, 1:], cell[1:, :-1], cell[1:, 1:])
    )
    rising = _distance(vertices, ll, ur) < _distance(vertices, lr, ul)
    rising = np.where((lr < 0) | (ul < 0), True, rising & (ll >= 0) & (ur >= 0))
    first = np.stack([ll, lr, np.where(rising, ur, ul)], axis=1)
    second = np.stack([np.where(rising, ll, lr), ur, ul], axis=1)
    triangles = np.stack([first, second], axis=1).reshape(-1, 3)
    triangles = triangles[(triangles >= 0).all(axis=1)]
    longest = np.stack([_distance(vertices, triangles[:, k], triangles[:, k - 1]) for k in range(3)]).max(
        axis=0
    )
    beside = np.concatenate(
        [_edges(vertices, cell[:, :-1], cell[:, 1:]), _edges(vertices, cell[:-1], cell[1:])]
    )
    kept = longest <= DEPTH_JUMP * (np.median(beside) if len(beside) else 0.0)
    detail = (
        f"the PLY: a range grid of {columns} x {rows} cells, {len(points)} with a point, is read as "
        f"{int(kept.sum())} triangles; {int((~kept).sum())} triangles with an edge of more than "
        f"{DEPTH_JUMP:g} times the median are left out as depth jumps"
    )
    return triangles[kept], Note(code="range_grid", detail=detail)


def indices(column: ListColumn, element: str) -> IndexArray:
    """(sum of counts,) int64 indices of vertices.

    Raises
    ------
    UnreadableFile
        When one is no whole number.
    """
    if column.items.dtype.kind == "f":
        wrong = ~(column.items == np.floor(column.items)) | (np.abs(column.items) > 2**53)
        if wrong.any():
            first = int(wrong.argmax())
            row = int(np.searchsorted(np.cumsum(column.counts), first, side="right"))
            raise UnreadableFile(
                f"row {row} of {element} in the PLY (the first is 0) refers to vertex "
                f"{column.items[first]:g}, which is no index"
            )
    return column.items.astype(np.int64)


def _check_corners(corners: IndexArray, counts: IndexArray, n_vertices: int, element: str) -> None:
    if corners.size and (corners.min() < 0 or corners.max() >= n_vertices):
        first = int(((corners < 0) | (corners >= n_vertices)).argmax())
        row = int(np.searchsorted(np.cumsum(counts), first, side="right"))
        raise _outside(element, row, int(corners[first]), n_vertices)


def _outside(element: str, row: int, corner: int, n_vertices: int) -> IndexOutOfRange:
    return IndexOutOfRange(
        f"row {row} of {element} in the PLY (the first is 0) refers to vertex {corner}, but there are "
        f"{n_vertices}, counted from 0"
    )


def _check_number(triangles: int, settings: LoadSettings, *, about: bool = False) -> None:
    if triangles > settings.max_faces * (3 if about else 1):
        raise MeshTooLarge(
            f"{'about ' if about else ''}{triangles} triangles; the limit is {settings.max_faces}"
        )


def _distance(vertices: FloatArray, a: IndexArray, b: IndexArray) -> FloatArray:
    with np.errstate(all="ignore"):
        return np.asarray(np.linalg.norm(vertices[a] - vertices[b], axis=1))


def _edges(vertices: FloatArray, a: IndexArray, b: IndexArray) -> FloatArray:
    """Distances of neighbours that both have a point."""
    both: BoolArray = (a >= 0) & (b >= 0)
    return _distance(vertices, a[both], b[both])
