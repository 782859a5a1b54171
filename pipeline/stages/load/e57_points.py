"""The points of one scan in an E57: a compressed vector, in packets of one stream of bits for each field.

Source: ASTM E2807-11, sections 9.3 to 9.7; bits are packed from the lowest on (bitPackCodec).
"""

import struct
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from pipeline.core.errors import TruncatedFile, UnreadableFile
from pipeline.core.mesh import FloatArray
from pipeline.stages.load.e57_pages import Pages

SECTION = struct.Struct("<B7xQQQ")
COMPRESSED_VECTOR = 1
INDEX_PACKET, DATA_PACKET, EMPTY_PACKET = 0, 1, 2
PACKET_HEADER_BYTES, DATA_HEADER_BYTES = 4, 6
#: Values that are unpacked at once: a multiple of 8, so that each block starts at a whole byte.
BLOCK = 1 << 18


@dataclass(frozen=True, slots=True)
class FieldType:
    """name : empty for a field of an extension; kind : Float, Integer, ScaledInteger or String; bytes : of a
    Float; minimum, maximum : of the stored integers; value = integer * scale + offset
    """

    name: str
    kind: str
    bytes: int = 8
    minimum: int = 0
    maximum: int = 0
    scale: float = 1.0
    offset: float = 0.0

    @property
    def bits(self) -> int:
        """Bits of one value; 0 where all are the same."""
        if self.kind == "Float":
            return 8 * self.bytes
        return (self.maximum - self.minimum).bit_length()


def read_fields(
    pages: Pages, at: int, count: int, fields: list[FieldType], wanted: set[str], where: str
) -> dict[str, FloatArray]:
    """(count,) values of each wanted field that the points have.

    at : offset of the section in the file; fields : all of the prototype, in its order

    Raises
    ------
    TruncatedFile, UnreadableFile
    """
    streams: dict[int, list[bytes]] = {
        number: [] for number, field in enumerate(fields) if field.name in wanted
    }
    if count:
        _collect(pages, at, len(fields), streams, where)
    read = {}
    for number, chunks in streams.items():
        field, stream = fields[number], b"".join(chunks)
        if len(stream) * 8 < field.bits * count:
            raise TruncatedFile(
                f"{where} of the E57 announces {count} points, and has {field.name} of "
                f"{len(stream) * 8 // field.bits}"
            )
        read[field.name] = _values(stream, count, field)
    return read


def _collect(pages: Pages, at: int, n_fields: int, streams: dict[int, list[bytes]], where: str) -> None:
    """Add to `streams` the bytes of its fields from every packet."""
    payload = pages.payload
    start = pages.start(at, f"the points of {where}")
    if start + SECTION.size > len(payload):
        raise TruncatedFile(f"the points of {where} of the E57 start where the file ends")
    kind, length, data_at, _ = SECTION.unpack_from(payload, start)
    if kind != COMPRESSED_VECTOR:
        raise UnreadableFile(f"the points of {where} of the E57 are a section of type {kind}, not of points")
    end = start + length
    if end > len(payload):
        raise TruncatedFile(
            f"the points of {where} of the E57 announce {length} bytes, beyond the end of the file"
        )
    position = pages.start(data_at, f"the first packet of {where}")
    while position + PACKET_HEADER_BYTES <= end:
        packet, _, size = struct.unpack_from("<BBH", payload, position)
        size += 1  # stored less one
        if packet not in (INDEX_PACKET, DATA_PACKET, EMPTY_PACKET) or size % 4 or position + size > end:
            raise UnreadableFile(
                f"a packet of {where} of the E57 is damaged, at byte {position} without checksums"
            )
        if packet == DATA_PACKET:
            _split(payload[position : position + size], n_fields, streams, where)
        position += size


def _split(packet: bytes, n_fields: int, streams: dict[int, list[bytes]], where: str) -> None:
    (n_streams,) = struct.unpack_from("<H", packet, PACKET_HEADER_BYTES) if len(packet) >= 6 else (0,)
    first = DATA_HEADER_BYTES + 2 * n_streams
    if n_streams != n_fields or first > len(packet):
        raise UnreadableFile(
            f"a packet of {where} of the E57 has {n_streams} fields; the points have {n_fields}"
        )
    ends = np.cumsum(np.frombuffer(packet, dtype="<u2", count=n_streams, offset=DATA_HEADER_BYTES), dtype=int)
    if n_streams and first + ends[-1] > len(packet):
        raise UnreadableFile(f"a packet of {where} of the E57 is shorter than its fields")
    for number, chunks in streams.items():
        begin = first + (int(ends[number - 1]) if number else 0)
        chunks.append(packet[begin : first + int(ends[number])])


def _values(stream: bytes, count: int, field: FieldType) -> FloatArray:
    if field.kind == "Float":
        kind = "<f4" if field.bytes == 4 else "<f8"
        return np.frombuffer(stream, dtype=kind, count=count).astype(np.float64)
    integers = unpacked(stream, count, field.bits).astype(np.float64) + field.minimum
    values: FloatArray = integers * field.scale + field.offset
    return values


def unpacked(stream: bytes, count: int, bits: int) -> npt.NDArray[np.uint64]:
    """(count,) integers of `bits` bits each (0 to 64), one after the other from the lowest bit on."""
    result = np.zeros(count, dtype=np.uint64)
    if bits == 0:
        return result
    padded = np.frombuffer(stream + bytes(16), dtype=np.uint8)
    mask = np.uint64(2**bits - 1)
    for first in range(0, count, BLOCK):
        at = np.arange(first, min(first + BLOCK, count), dtype=np.int64) * bits
        place, shift = at >> 3, (at & 7).astype(np.uint64)
        low = np.zeros(len(at), dtype=np.uint64)
        for number in range(8):
            low |= padded[place + number].astype(np.uint64) << np.uint64(8 * number)
        values = low >> shift
        if bits > 57:  # 7 bits of shift and 57 more are in eight bytes; the rest is in the ninth
            ninth = padded[place + 8].astype(np.uint64)
            values |= np.where(
                shift > 0, ninth << (np.uint64(64) - np.maximum(shift, 1).astype(np.uint64)), 0
            )
        result[first : first + len(at)] = values & mask
    return result
