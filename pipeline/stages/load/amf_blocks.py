"""The fast path for meshes of an AMF: runs of plain vertices and triangles are read as tables, and taken out
of the XML. The XML parser reads what is left; a run of another form stays for it.
"""

import re
from typing import Any

import numpy as np
import numpy.typing as npt

from pipeline.stages.load.number_text import parsed

#: Attribute of the element that stands for a run.
MARK = "cusp-rows"
#: What stands for a run of triangles; one of vertices is `vertices` itself.
TRIANGLES = "triangles"
_VERTICES = re.compile(rb"<vertices\s*>(.*?)</vertices\s*>", re.DOTALL)
_TRIANGLES = re.compile(rb"<triangle\s*>.*?(?=</volume\s*>)", re.DOTALL)
_VERTEX = b"<vertex><coordinates><x></x><y></y><z></z></coordinates></vertex>"
_TRIANGLE = b"<triangle><v1></v1><v2></v2><v3></v3></triangle>"
_TEXT, _TAG = re.compile(rb">[^<>]+<"), re.compile(rb"<[^<>]*>")
_DIGITS_AND_SPACE = b"0123456789 \t\r\n"


def cut(data: bytes) -> tuple[bytes, list[npt.NDArray[Any]]]:
    """The XML without its plain runs, and their tables: (3 n,) float64 of vertices, (3 m,) int64 of corners.

    A run is an empty element with the number of its table as the attribute `MARK`; lines stay the same.
    """
    # without comments, CDATA, DTD and processing instructions each `<` is the start of an element
    if b"<!" in data or data.count(b"<?") > 1 or MARK.encode() in data:
        return data, []
    tables: list[npt.NDArray[Any]] = []

    def vertices(match: re.Match[bytes]) -> bytes:
        return _replaced(match[0], match[1], _VERTEX, b"vertices", tables)

    def triangles(match: re.Match[bytes]) -> bytes:
        return _replaced(match[0], match[0], _TRIANGLE, TRIANGLES.encode(), tables)

    return _TRIANGLES.sub(triangles, _VERTICES.sub(vertices, data)), tables


def _replaced(whole: bytes, run: bytes, row: bytes, name: bytes, tables: list[npt.NDArray[Any]]) -> bytes:
    """The element that stands for a run, or `whole` as it is."""
    count = run.count(row[: row.index(b">") + 1])
    if count == 0 or _TEXT.sub(b"><", b">" + run + b"<") != b">" + row * count + b"<":
        return whole
    text = _TAG.sub(b" ", run)
    if row is _TRIANGLE and text.translate(None, _DIGITS_AND_SPACE):
        return whole
    values, stopped = parsed(text, 3 * count)
    if stopped is not None or len(values) != 3 * count or (row is _TRIANGLE and values.max() >= 2**53):
        return whole
    tables.append(values if row is _VERTEX else values.astype(np.int64))
    lines = b"\n" * whole.count(b"\n")
    return b'<%b %b="%d"/>%b' % (name, MARK.encode(), len(tables) - 1, lines)
