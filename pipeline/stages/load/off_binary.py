"""Binary OFF: big-endian integers and single precision numbers after the line `OFF BINARY`.

Source: Geomview manual 1.9, sections 4.1.6 and 4.2.5.
"""

import struct

import numpy as np

from pipeline.core.errors import UnreadableFile
from pipeline.core.formats import Format
from pipeline.core.mesh import IndexArray
from pipeline.stages.load.off_records import (
    Header,
    Polygons,
    check_counts,
    check_dimension,
    check_indices,
    in_space,
    truncated,
)


def read_binary(data: bytes, header: Header) -> Polygons:
    """The polygons of a binary OFF.

    Raises
    ------
    TruncatedFile, UnreadableFile, IndexOutOfRange
    """
    start, n_words = header.start, 4 if header.n_dimensions else 3
    if len(data) < start + 4 * n_words:
        raise truncated((0, 0), (0, 0)) if len(data) < start else _no_counts()
    *dimension, n_vertices, n_faces, _edges = struct.unpack_from(f">{n_words}i", data, start)
    if dimension:
        check_dimension(header, dimension[0])
    check_counts(n_vertices, n_faces)
    start += 4 * n_words
    end = start + 4 * header.width * n_vertices
    if end > len(data):
        raise truncated((n_vertices, n_faces), ((len(data) - start) // (4 * header.width), 0))
    table = np.frombuffer(data, dtype=">f4", count=header.width * n_vertices, offset=start)
    with np.errstate(invalid="ignore"):  # a NaN may be a signalling one
        numbers = table.reshape(n_vertices, header.width)[:, : header.coordinates].astype(np.float64)
    vertices = in_space(numbers)
    corners, counts, end = _faces(data, end, n_vertices, n_faces)
    check_indices(corners, counts, n_vertices, None)
    rest = len(data) - end
    return Polygons(vertices, None, corners, counts, f"{rest} bytes" if rest else "")


def _no_counts() -> UnreadableFile:
    return UnreadableFile(f"the binary {Format.OFF} ends before its counts of vertices and faces")


def _faces(data: bytes, start: int, n_vertices: int, n_faces: int) -> tuple[IndexArray, IndexArray, int]:
    """Corners and counts of the faces, and where they end. Each is: number of corners, corners, number of
    components of a colour, components.
    """
    words = np.frombuffer(data, dtype=">i4", count=(len(data) - start) // 4, offset=start)
    if n_faces and len(words) >= 2:
        n_corners = int(words[0])
        if 0 <= n_corners < len(words) - 1:
            size = n_corners + 2 + int(words[n_corners + 1])
            if n_corners + 2 <= size <= n_corners + 6 and size * n_faces <= len(words):
                table = words[: size * n_faces].reshape(n_faces, size)
                if (table[:, 0] == n_corners).all() and (
                    table[:, n_corners + 1] == size - n_corners - 2
                ).all():
                    corners = table[:, 1 : n_corners + 1].astype(np.int64).ravel()
                    return corners, np.full(n_faces, n_corners), start + 4 * size * n_faces
    values = words.tolist()
    corners_list: list[int] = []
    counts: list[int] = []
    position = 0
    for face in range(n_faces):
        count = values[position] if position < len(values) else 0
        colour = position + count + 1
        if count < 0 or (colour < len(values) and not 0 <= values[colour] <= 4):
            raise UnreadableFile(
                f"face {face} (the first is 0) of the binary {Format.OFF} announces {count} corners"
                + (f" and a colour of {values[colour]} numbers" if count >= 0 else "")
            )
        if colour >= len(values) or colour + values[colour] >= len(values):
            raise truncated((n_vertices, n_faces), (n_vertices, face))
        corners_list += values[position + 1 : colour]
        counts.append(count)
        position = colour + 1 + values[colour]
    return np.array(corners_list, dtype=np.int64), np.array(counts, dtype=np.int64), start + 4 * position
