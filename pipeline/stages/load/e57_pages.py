"""The pages of an E57 file: 1,024 bytes each, the last four of which are a checksum of the others.

Source: ASTM E2807-11, section 8 (file structure); CRC-32C (RFC 3720, appendix B.4).
"""

import struct
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from pipeline.core.errors import TruncatedFile, UnreadableFile

SIGNATURE = b"ASTM-E57"
HEADER = struct.Struct("<8sIIQQQQ")
PAGE_BYTES, CHECKSUM_BYTES = 1024, 4
PAYLOAD_BYTES = PAGE_BYTES - CHECKSUM_BYTES
#: The polynomial of Castagnoli, bits reversed.
POLYNOMIAL = 0x82F63B78
#: Pages whose checksums are computed at once.
BLOCK = 4096


@dataclass(frozen=True, slots=True, eq=False)
class Pages:
    """payload : bytes of the file without checksums; xml_start, xml_bytes : of the XML section in it"""

    payload: bytes
    xml_start: int
    xml_bytes: int

    def start(self, physical: int, where: str) -> int:
        """The place in `payload` of an offset in the file."""
        page, within = divmod(physical, PAGE_BYTES)
        place = page * PAYLOAD_BYTES + within
        if within >= PAYLOAD_BYTES or not 0 <= place < len(self.payload):
            raise UnreadableFile(f"{where} of the E57 is said to start at byte {physical}, where no data is")
        return place

    @property
    def xml(self) -> bytes:
        """The XML section, as it is."""
        return self.payload[self.xml_start : self.xml_start + self.xml_bytes]


def read_pages(data: bytes) -> Pages:
    """Check the header and the checksum of every page.

    Raises
    ------
    TruncatedFile, UnreadableFile
    """
    if len(data) < HEADER.size:
        raise TruncatedFile(f"the E57 has {len(data)} bytes; its header alone has {HEADER.size}")
    _, major, minor, length, xml_at, xml_bytes, page_bytes = HEADER.unpack_from(data)
    if major != 1:
        raise UnreadableFile(f"the E57 has version {major}.{minor}, which is not read")
    if page_bytes != PAGE_BYTES:
        raise UnreadableFile(f"the E57 has pages of {page_bytes} bytes; the standard knows {PAGE_BYTES} only")
    if length > len(data):
        raise TruncatedFile(f"the E57 announces {length} bytes and has {len(data)}")
    if length == 0 or length % PAGE_BYTES:
        raise UnreadableFile(f"the E57 announces {length} bytes, which are no whole pages of {PAGE_BYTES}")
    pages = np.frombuffer(data, dtype=np.uint8, count=length).reshape(-1, PAGE_BYTES)
    _check(pages)
    found = Pages(pages[:, :PAYLOAD_BYTES].tobytes(), 0, xml_bytes)
    start = found.start(xml_at, "the XML section")
    if start + xml_bytes > len(found.payload):
        raise TruncatedFile(
            f"the XML section of the E57 announces {xml_bytes} bytes, beyond the end of the file"
        )
    return Pages(found.payload, start, xml_bytes)


def _check(pages: npt.NDArray[np.uint8]) -> None:
    for first in range(0, len(pages), BLOCK):
        block = pages[first : first + BLOCK]
        stored = np.ascontiguousarray(block[:, PAYLOAD_BYTES:]).view(">u4")[:, 0]
        bad = np.flatnonzero(checksums(block[:, :PAYLOAD_BYTES]) != stored)
        if bad.size:
            raise UnreadableFile(
                f"the E57 is damaged: the checksum of page {first + int(bad[0])} (bytes "
                f"{(first + int(bad[0])) * PAGE_BYTES} and on) is wrong",
                remedy="the upload or the export went wrong: export the file and send it again",
            )


def checksums(payloads: npt.NDArray[np.uint8]) -> npt.NDArray[np.uint32]:
    """CRC-32C of each row (k, 4 n), four bytes at a time."""
    words = np.ascontiguousarray(np.ascontiguousarray(payloads).view("<u4").T)
    state = np.full(len(payloads), 0xFFFFFFFF, dtype=np.uint32)
    for word in words:
        state ^= word
        state = (
            _TABLES[3][state & 255]
            ^ _TABLES[2][(state >> 8) & 255]
            ^ _TABLES[1][(state >> 16) & 255]
            ^ _TABLES[0][state >> 24]
        )
    result: npt.NDArray[np.uint32] = ~state
    return result


def _tables() -> npt.NDArray[np.uint32]:
    """(4, 256): what a byte contributes that is followed by 0 to 3 others."""
    first = np.arange(256, dtype=np.uint32)
    for _ in range(8):
        first = np.where(first & 1, (first >> 1) ^ np.uint32(POLYNOMIAL), first >> 1).astype(np.uint32)
    tables = [first]
    for _ in range(3):
        tables.append(first[tables[-1] & 255] ^ (tables[-1] >> 8))
    return np.stack(tables)


_TABLES = _tables()
