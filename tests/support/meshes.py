"""Small meshes by formula, as files: an asymmetric blob, and the same moved."""

import math
import struct
from collections.abc import Sequence

Point = tuple[float, float, float]
#: Where the scan of the end-to-end tests lies: turned about z, then shifted.
TURN_DEG, SHIFT_MM = 25.0, (4.0, -3.0, 2.0)


def blob_stl(
    rows: int = 20, columns: int = 40, *, turn_deg: float = 0.0, shift_mm: Point = (0.0, 0.0, 0.0)
) -> bytes:
    """Binary STL of a closed bumpy blob about 40 mm across with rows * columns vertices, outward faces, no
    symmetry.

    `turn_deg` about the z axis, then `shift_mm`.
    """
    points = [[_point(row, column, rows, columns) for column in range(columns)] for row in range(rows)]
    north, south = (0.0, 0.0, _radius(0.0, 0.0)), (0.0, 0.0, -_radius(math.pi, 0.0))
    faces: list[tuple[Point, Point, Point]] = []
    for column in range(columns):
        after = (column + 1) % columns
        faces.append((north, points[0][column], points[0][after]))
        faces.append((south, points[-1][after], points[-1][column]))
        for row in range(rows - 1):
            a, b, c, d = (
                points[row][column],
                points[row][after],
                points[row + 1][column],
                points[row + 1][after],
            )
            faces += [(a, c, d), (a, d, b)]
    moved = [[_moved(point, math.radians(turn_deg), shift_mm) for point in face] for face in faces]
    return stl(moved)


def stl(faces: Sequence[Sequence[Point]]) -> bytes:
    """Binary STL of triangles; normals are left zero, as many programs do."""
    body = b"".join(
        struct.pack("<12fH", 0.0, 0.0, 0.0, *(value for point in face for value in point), 0)
        for face in faces
    )
    return b"blob".ljust(80) + struct.pack("<I", len(faces)) + body


def _radius(polar: float, azimuth: float) -> float:
    """Bumps of unequal size and place, so that no rotation or reflection maps the blob onto itself."""
    x, y, z = math.sin(polar) * math.cos(azimuth), math.sin(polar) * math.sin(azimuth), math.cos(polar)
    bumps = [
        ((0.8, 0.3, 0.5), 5.0),
        ((-0.5, 0.7, -0.3), 3.5),
        ((0.1, -0.9, 0.4), 4.2),
        ((-0.3, -0.2, -0.9), 2.8),
    ]
    return 16.0 + sum(
        height * math.exp(-6.0 * (math.dist((x, y, z), tuple(v / math.hypot(*centre) for v in centre)) ** 2))
        for centre, height in bumps
    )


def _point(row: int, column: int, rows: int, columns: int) -> Point:
    polar, azimuth = math.pi * (row + 1) / (rows + 1), 2 * math.pi * column / columns
    r = _radius(polar, azimuth)
    return (
        r * math.sin(polar) * math.cos(azimuth),
        r * math.sin(polar) * math.sin(azimuth),
        r * math.cos(polar),
    )


def _moved(point: Point, turn: float, shift: Point) -> Point:
    x, y, z = point
    c, s = math.cos(turn), math.sin(turn)
    return (c * x - s * y + shift[0], s * x + c * y + shift[1], z + shift[2])
