"""The structure of a VTK XML file, and its appended data.

Appended data may be raw bytes, which no XML parser takes: they are cut out first.
"""

import re
from dataclasses import dataclass
from typing import Any

from lxml import etree  # type: ignore[import-untyped]

from pipeline.core.errors import TruncatedFile, UnreadableFile

_APPENDED = re.compile(rb"<AppendedData\b[^>]{0,200}>")
_ENCODING = re.compile(rb"encoding\s*=\s*[\"'](\w+)[\"']")
_END = b"</AppendedData>"
#: Nothing is fetched, and no entity is expanded. Long texts are base64: the file bounds them.
_OPTIONS: dict[str, Any] = {"resolve_entities": False, "no_network": True, "huge_tree": True}


@dataclass(frozen=True, slots=True, eq=False)
class VtkFile:
    """pieces : elements; order : `<` or `>`; header : numpy type of sizes; compressor : as the file says;
    appended : the data after `_`; is_raw : whether they are no base64
    """

    pieces: list[Any]
    order: str
    header: str
    compressor: str
    appended: bytes
    is_raw: bool


def open_vtk(data: bytes) -> VtkFile:
    """Raise TruncatedFile or UnreadableFile when the file is damaged, or is no PolyData."""
    xml, appended, is_raw = _split(data)
    if b"<!DOCTYPE" in xml or b"<!ENTITY" in xml:
        raise UnreadableFile("the VTP declares a document type or entities, which are not read")
    try:
        root = etree.fromstring(xml, etree.XMLParser(**_OPTIONS))
    except (etree.XMLSyntaxError, ValueError) as error:
        line = getattr(error, "lineno", None) or 1
        if not re.search(rb"</VTKFile\s*>\s*\Z", xml):
            raise TruncatedFile(
                f"the VTP ends in line {xml.count(bytes([10])) + 1} without </VTKFile>"
            ) from error
        raise UnreadableFile(
            f"the VTP, line {line}: the XML is not well-formed ({str(error)[:100]})"
        ) from error
    kind = root.get("type") or "(none)"
    if root.tag != "VTKFile" or kind != "PolyData":
        raise UnreadableFile(
            f"the VTK file is of type {kind[:40]}, which is not read",
            remedy="extract the surface as PolyData (in ParaView: Extract Surface), and save it as VTP",
        )
    return VtkFile(
        root.findall("PolyData/Piece"),
        _choice(root, "byte_order", {"LittleEndian": "<", "BigEndian": ">"}, "LittleEndian"),
        _choice(root, "header_type", {"UInt32": "u4", "UInt64": "u8"}, "UInt32"),
        root.get("compressor") or "",
        appended,
        is_raw,
    )


def _choice(root: Any, name: str, known: dict[str, str], default: str) -> str:
    value = root.get(name) or default
    if value not in known:
        raise UnreadableFile(f"the VTP has {name} {value[:40]!r}, which is not known")
    return known[value]


def _split(data: bytes) -> tuple[bytes, bytes, bool]:
    """The XML without appended data, the data after `_`, and whether they are raw."""
    start = _APPENDED.search(data)
    if start is None or start[0].endswith(b"/>"):
        return data, b"", False
    end = data.rfind(_END)
    if end < start.end():
        raise TruncatedFile(f"the VTP of {len(data)} bytes ends within its appended data")
    content = data[start.end() : end]
    marker = content.find(b"_")
    if marker < 0:
        raise UnreadableFile("the appended data of the VTP do not start with _")
    encoding = _ENCODING.search(start[0])
    is_raw = encoding is None or encoding[1] != b"base64"
    return data[: start.end()] + data[end:], content[marker + 1 :], is_raw
