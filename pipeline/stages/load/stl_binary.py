"""Binary STL: a header of 80 bytes, the number of triangles, and 50 bytes for each."""

import numpy as np

from pipeline.core.errors import MeshTooLarge, TruncatedFile, UnreadableFile
from pipeline.core.formats import STL_FACE_BYTES, STL_HEADER_BYTES, STL_UNKNOWN_COUNT
from pipeline.core.mesh import FloatArray, IndexArray
from pipeline.core.results import Note
from pipeline.core.settings import LoadSettings
from pipeline.stages.load.contents import Body, Contents

FACET = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])
#: Bytes after the last triangle that are not worth a note. Chosen by hand: a line end or a small record.
FEW_BYTES = 100


def read_binary_stl(data: bytes, settings: LoadSettings) -> Contents:
    """The triangles of all STL blocks of `data`, in one body.

    Raises
    ------
    TruncatedFile, UnreadableFile, MeshTooLarge
    """
    if len(data) < STL_HEADER_BYTES:
        raise TruncatedFile(f"a binary STL has a header of 84 bytes, but the file has {len(data)} bytes")
    announced = _announced(data, 0)
    left = len(data) - STL_HEADER_BYTES
    there, rest = divmod(left, STL_FACE_BYTES)
    if announced in (0, STL_UNKNOWN_COUNT) and left > 0:
        if rest:
            raise UnreadableFile(
                f"the STL header announces {announced} triangles, and {left} bytes follow, which are "
                f"{there} triangles of 50 bytes and {rest} bytes more"
            )
        detail = (
            f"the STL header announces {announced} triangles, as written to a stream; "
            f"all {there} triangles of the file are read, by its size"
        )
        return _contents(data, [(0, there)], settings, [Note(code="stl_count", detail=detail)])
    if announced > there:
        raise TruncatedFile(
            f"the STL header announces {announced} triangles, which is "
            f"{STL_HEADER_BYTES + STL_FACE_BYTES * announced} bytes; the file has {len(data)}, "
            f"which is {there} triangles"
        )
    after = left - announced * STL_FACE_BYTES
    if after == 0 or announced == 0:
        return _contents(data, [(0, announced)], settings, [])
    return _with_more(data, announced, after, settings)


def _with_more(data: bytes, announced: int, after: int, settings: LoadSettings) -> Contents:
    """What follows the first block: more blocks, the attributes of the triangles, or other bytes."""
    blocks = _blocks(data)
    if len(blocks) > 1:
        total = sum(count for _, count in blocks)
        detail = (
            f"the file is {len(blocks)} binary STL files one after the other; all {total} triangles are read"
        )
        return _contents(data, blocks, settings, [Note(code="several_stl", detail=detail)])
    starts = _with_attributes(data, announced)
    if starts is not None:
        _check_number(announced, settings)
        places = starts[:, None] + np.arange(12, STL_FACE_BYTES - 2)
        raw = np.frombuffer(data, dtype=np.uint8)[places]
        return Contents((_body(raw.view("<f4").astype(np.float64).reshape(-1, 3)),))
    notes = []
    if after > FEW_BYTES:
        whole, rest = divmod(after, STL_FACE_BYTES)
        more = f"; they have the size of {whole} more triangles" if rest == 0 else ""
        detail = (
            f"{after} bytes follow the {announced} triangles that the STL header announces, "
            f"and are not read{more}"
        )
        notes.append(Note(code="bytes_after_stl", detail=detail))
    return _contents(data, [(0, announced)], settings, notes)


def _announced(data: bytes, at: int) -> int:
    return int.from_bytes(data[at + 80 : at + 84], "little")


def _blocks(data: bytes) -> list[tuple[int, int]]:
    """Start and triangles of each STL of several that fill `data` exactly; of the first only, if not."""
    blocks, at = [], 0
    while at + STL_HEADER_BYTES + STL_FACE_BYTES <= len(data):
        count = _announced(data, at)
        end = at + STL_HEADER_BYTES + STL_FACE_BYTES * count
        if count == 0 or end > len(data):
            break
        blocks.append((at, count))
        at = end
    return blocks if at == len(data) else blocks[:1]


def _with_attributes(data: bytes, announced: int) -> IndexArray | None:
    """Byte of each triangle where the attribute of each is the number of bytes that follow it, as the
    specification has it; None if they are colours, as almost everywhere, and do not add up to the size.
    """
    facets = np.frombuffer(data, dtype=FACET, count=announced, offset=STL_HEADER_BYTES)
    if not facets["attribute"].any():
        return None
    starts = np.zeros(announced, dtype=np.int64)
    at = STL_HEADER_BYTES
    for number in range(announced):
        starts[number] = at
        at += STL_FACE_BYTES
        if at > len(data):
            return None
        at += data[at - 2] + 256 * data[at - 1]
    return starts if at == len(data) else None


def _contents(
    data: bytes, blocks: list[tuple[int, int]], settings: LoadSettings, notes: list[Note]
) -> Contents:
    _check_number(sum(count for _, count in blocks), settings)
    corners = [
        np.frombuffer(data, dtype=FACET, count=count, offset=at + STL_HEADER_BYTES)["corners"]
        for at, count in blocks
    ]
    with np.errstate(invalid="ignore"):  # a NaN may be a signalling one
        vertices = [each.astype(np.float64).reshape(-1, 3) for each in corners]
    return Contents(
        (_body(vertices[0] if len(vertices) == 1 else np.concatenate(vertices)),), notes=tuple(notes)
    )


def _check_number(triangles: int, settings: LoadSettings) -> None:
    if triangles > settings.max_faces:
        raise MeshTooLarge(f"{triangles} triangles; the limit is {settings.max_faces}")


def _body(vertices: FloatArray) -> Body:
    return Body(vertices, np.arange(len(vertices), dtype=np.int32).reshape(-1, 3))
