"""Checks of the chunks of a LAZ against the size of its file, before they are decoded.

`lazrs` allocates what the file says: the entries of the chunk table, and the layers of each chunk of the
point formats 6 to 10. A damaged number would take gigabytes, or end the process.
Source: LAZ specification 1.4-R1, sections 2 (LASzip VLR) and 3 (chunks, chunk table).
"""

import io
import struct
from itertools import accumulate
from typing import Any

from pipeline.core.errors import TruncatedFile, UnreadableFile

#: The LASzip record: place of the number of items, which follow with type, size and version.
ITEMS_AT = 32
#: Layers of the items of layered formats, by type; of extra bytes (14), one for each byte.
LAYERS = {10: 9, 11: 1, 12: 2, 13: 1}
EXTRA_BYTES = 14


def check_chunks(data: bytes, header: Any) -> None:
    """header : of `laspy`

    Raises
    ------
    TruncatedFile, UnreadableFile
        When a number announces more than the file has.
    """
    import lazrs

    start = int(header.offset_to_point_data)
    _check_table(data, start)
    record = header.vlrs[header.vlrs.index("LasZipVlr")].record_data
    sizes, layers = _items(record)
    if not layers:
        return
    source = io.BytesIO(data)
    source.seek(start)
    table = lazrs.read_chunk_table(source, lazrs.LazVlr(record)) or []
    for number, at in enumerate(accumulate((size for _, size in table[:-1]), initial=start + 8)):
        first = at + sizes + 4  # one point as it is, the number of points, the sizes of the layers
        if first + 4 * layers > len(data):
            raise TruncatedFile(f"chunk {number} of the LAZ starts at byte {at}, where the file ends")
        announced = sum(struct.unpack_from(f"<{layers}I", data, first))
        if first + 4 * layers + announced > len(data):
            raise TruncatedFile(
                f"chunk {number} of the LAZ announces {announced} bytes, and {len(data) - at} are left"
            )


def _check_table(data: bytes, start: int) -> None:
    if start + 8 > len(data):
        raise TruncatedFile(f"the LAZ has {len(data)} bytes, and its points start at byte {start}")
    (at,) = struct.unpack_from("<q", data, start)
    if at == -1:  # written to a stream: the place is at the end
        (at,) = struct.unpack_from("<q", data, len(data) - 8)
    if not 0 <= at <= len(data) - 8:
        raise TruncatedFile(f"the chunk table of the LAZ is at byte {at}, and the file has {len(data)} bytes")
    (n_chunks,) = struct.unpack_from("<I", data, at + 4)
    if n_chunks > len(data):
        raise UnreadableFile(f"the LAZ announces {n_chunks} chunks, more than its {len(data)} bytes hold")


def _items(record: bytes) -> tuple[int, int]:
    """Bytes of a point, and the number of layers of a chunk; no layers in the older formats."""
    (count,) = struct.unpack_from("<H", record, ITEMS_AT)
    items = [struct.unpack_from("<HHH", record, ITEMS_AT + 2 + 6 * number) for number in range(count)]
    layers = sum(size if kind == EXTRA_BYTES else LAYERS.get(kind, 0) for kind, size, _ in items)
    return sum(size for _, size, _ in items), layers
