"""VTP files in every layout of VTK XML: text, base64 inline or appended, raw, compressed, any byte order."""

import base64
import lzma
import zlib
from dataclasses import dataclass, field
from typing import Any

import numpy as np

TYPES = {"i1": "Int8", "i4": "Int32", "i8": "Int64", "u4": "UInt32", "f4": "Float32", "f8": "Float64"}


@dataclass
class Layout:
    """joined : the sizes and the data are one text of base64, not two"""

    format: str = "ascii"
    encoding: str = "base64"
    order: str = "<"
    header: str = "u4"
    compressor: str = ""
    block: int = 64
    joined: bool = False
    points: str = "f4"
    indices: str = "i8"
    appended: bytes = field(default=b"", init=False)

    def array(self, name: str, values: Any, components: int = 1) -> bytes:
        kind = self.points if components == 3 else self.indices
        head = f'<DataArray type="{TYPES[kind]}" Name="{name}" NumberOfComponents="{components}"'
        flat = np.asarray(values).ravel()
        if self.format == "ascii":
            text = " ".join(repr(float(x)) if kind[0] == "f" else str(int(x)) for x in flat)
            return f'{head} format="ascii">\n{text}\n</DataArray>\n'.encode()
        sizes, content = self._packed(flat.astype(self.order + kind).tobytes())
        if self.format == "appended" and self.encoding == "raw":
            encoded = sizes + content
        elif self.joined:
            encoded = base64.b64encode(sizes + content)
        else:
            encoded = base64.b64encode(sizes) + base64.b64encode(content)
        if self.format == "binary":
            return f'{head} format="binary">\n'.encode() + encoded + b"\n</DataArray>\n"
        offset = len(self.appended)
        self.appended += encoded
        return f'{head} format="appended" offset="{offset}"/>\n'.encode()

    def _packed(self, content: bytes) -> tuple[bytes, bytes]:
        header = np.dtype(self.order + self.header)
        if not self.compressor:
            return np.array([len(content)], dtype=header).tobytes(), content
        pack = zlib.compress if "ZLib" in self.compressor else lzma.compress
        blocks = [content[at : at + self.block] for at in range(0, len(content), self.block)]
        packed = [pack(each) for each in blocks]
        last = len(content) % self.block
        sizes = [len(blocks), self.block, last, *map(len, packed)]
        return np.array(sizes, dtype=header).tobytes(), b"".join(packed)

    def file(self, *pieces: bytes, kind: str = "PolyData") -> bytes:
        order = "LittleEndian" if self.order == "<" else "BigEndian"
        attributes = f'type="{kind}" version="1.0" byte_order="{order}"'
        if self.header != "u4":
            attributes += ' header_type="UInt64"'
        if self.compressor:
            attributes += f' compressor="{self.compressor}"'
        appended = b""
        if self.appended:
            appended = f'<AppendedData encoding="{self.encoding}">\n_'.encode() + self.appended
            appended += b"\n</AppendedData>\n"
        body = b"".join(pieces)
        return (
            f'<?xml version="1.0"?>\n<VTKFile {attributes}>\n<{kind}>\n'.encode()
            + body
            + f"</{kind}>\n".encode()
            + appended
            + b"</VTKFile>\n"
        )

    def piece(self, points: Any, **cells: list[list[int]]) -> bytes:
        """cells : Verts, Lines, Strips, Polys, each a list of corners for each cell"""
        counts = "".join(f' NumberOf{kind}="{len(each)}"' for kind, each in cells.items())
        made = f'<Piece NumberOfPoints="{len(points)}"{counts}>\n<Points>\n'.encode()
        made += self.array("Points", points, 3) + b"</Points>\n"
        for kind, each in cells.items():
            flat = [corner for cell in each for corner in cell]
            ends = np.cumsum([len(cell) for cell in each])
            made += f"<{kind}>\n".encode() + self.array("connectivity", flat)
            made += self.array("offsets", ends) + f"</{kind}>\n".encode()
        return made + b"</Piece>\n"
