"""The XML of an AMF, as records: objects with volumes, constellations with instances.

Read element by element, so that memory grows with the mesh and not with its text.
Source: ISO/ASTM 52915:2020 (AMF 1.2).
"""

import io
import re
from array import array
from dataclasses import dataclass, field
from typing import Any

import numpy.typing as npt
from lxml import etree  # type: ignore[import-untyped]

from pipeline.core.errors import MeshTooLarge, TruncatedFile, UnreadableFile
from pipeline.core.formats import as_utf8
from pipeline.core.settings import LoadSettings
from pipeline.stages.load.amf_blocks import MARK, TRIANGLES, cut
from pipeline.stages.load.three_mf_xml import OPTIONS

#: Elements that are read whole, and then forgotten.
_READ = (
    "vertices",
    TRIANGLES,
    "vertex",
    "edge",
    "triangle",
    "volume",
    "object",
    "instance",
    "constellation",
    "metadata",
    "amf",
)
#: Digits of an index that may be too large for 64 bits, and what is read instead: no mesh has that vertex.
MAX_DIGITS, LARGEST = 19, 2**63 - 1


@dataclass(slots=True)
class Volume:
    """triangles : corners, three for each; metadata : by type, keys in lower case"""

    triangles: "array[int]"
    kind: str
    metadata: dict[str, str]


@dataclass(slots=True)
class AmfObject:
    """coordinates : three for each vertex; n_curved : edges and vertices that say how triangles are curved"""

    coordinates: "array[float]" = field(default_factory=lambda: array("d"))
    volumes: list[Volume] = field(default_factory=list)
    metadata: dict[str, str] = field(default_factory=dict)
    n_curved: int = 0


@dataclass(frozen=True, slots=True)
class Instance:
    """values : deltax, rx, scale ... as numbers; line : in the file"""

    target: str
    values: dict[str, float]
    line: int


@dataclass(slots=True)
class Amf:
    """objects, constellations : by id"""

    unit: str = "millimeter"
    objects: dict[str, AmfObject] = field(default_factory=dict)
    constellations: dict[str, list[Instance]] = field(default_factory=dict)
    metadata: dict[str, str] = field(default_factory=dict)


def read_xml(data: bytes, settings: LoadSettings) -> Amf:
    """Raise TruncatedFile, UnreadableFile or MeshTooLarge, with the line."""
    text = as_utf8(data)  # for a look at it; the parser goes by the byte order mark and the declaration
    if b"<!DOCTYPE" in text or b"<!ENTITY" in text:
        raise UnreadableFile("the AMF declares a document type or entities, which are not read")
    skeleton, tables = cut(data)
    amf, reader = Amf(), _Reader(settings, tables)
    try:
        for event, node in etree.iterparse(io.BytesIO(skeleton), events=("start", "end"), **OPTIONS):
            if not isinstance(node.tag, str):
                continue
            tag = _local(node)
            if event == "start":
                if tag == "amf":
                    amf.unit = (node.get("unit") or "millimeter").strip().lower()
                continue
            if tag in _READ:
                reader.take(tag, node, amf)
                node.clear()
                parent = node.getparent()
                while parent is not None and node.getprevious() is not None:
                    del parent[0]
    except etree.XMLSyntaxError as error:
        if not re.search(rb"</(?:\w+:)?amf\s*>\s*\Z", text[-200:], re.IGNORECASE):
            raise TruncatedFile(f"the AMF ends at line {error.lineno or 1} without </amf>") from error
        reason = re.sub(r",? ?line \d+.*", "", str(error.msg))
        raise UnreadableFile(
            f"the AMF, line {error.lineno}: the XML is not well-formed ({reason})"
        ) from error
    return amf


class _Reader:
    """The parts of what is not complete yet."""

    def __init__(self, settings: LoadSettings, tables: list[npt.NDArray[Any]]) -> None:
        self._tables = tables
        self._settings = settings
        self._n_vertices = self._n_triangles = 0
        self._object = AmfObject()
        self._triangles = array("q")
        self._instances: list[Instance] = []
        self._metadata: dict[str, str] = {}
        self._volume_metadata: dict[str, str] = {}

    def take(self, tag: str, node: Any, amf: Amf) -> None:
        """An element that is complete."""
        if tag in ("vertices", TRIANGLES):
            self._table(node)
        elif tag == "vertex":
            self._vertex(node)
        elif tag == "edge":
            self._object.n_curved += 1
        elif tag == "triangle":
            self._triangle(node)
        elif tag == "volume":
            metadata, self._volume_metadata = self._volume_metadata, {}
            self._object.volumes.append(Volume(self._triangles, (node.get("type") or "").lower(), metadata))
            self._triangles = array("q")
        elif tag == "object":
            self._object.metadata, self._metadata = self._metadata, {}
            amf.objects[node.get("id") or ""] = self._object
            self._object = AmfObject()
        elif tag == "instance":
            values = {_local(each): _real(each, node) for each in node if _has_text(each)}
            self._instances.append(Instance(node.get("objectid") or "", values, node.sourceline or 0))
        elif tag == "constellation":
            amf.constellations[node.get("id") or ""] = self._instances
            self._instances = []
        elif tag == "metadata":
            self._take_metadata(node, amf)

    def _take_metadata(self, node: Any, amf: Amf) -> None:
        key, value = (node.get("type") or "").lower(), (node.text or "").strip()
        parent = node.getparent()
        owner = "" if parent is None else _local(parent)
        where = {"amf": amf.metadata, "object": self._metadata, "volume": self._volume_metadata}.get(owner)
        if where is not None:
            where[key] = value

    def _table(self, node: Any) -> None:
        """Rows that were cut out."""
        if node.get(MARK) is None or not self._tables:
            return
        table = self._tables[int(node.get(MARK))]
        if table.dtype.kind == "f":
            self._object.coordinates.frombytes(table.tobytes())
            self._count(vertices=len(table) // 3)
        else:
            self._triangles.frombytes(table.tobytes())
            self._count(triangles=len(table) // 3)

    def _count(self, vertices: int = 0, triangles: int = 0) -> None:
        self._n_vertices, self._n_triangles = self._n_vertices + vertices, self._n_triangles + triangles
        if self._n_vertices > self._settings.max_vertices:
            raise MeshTooLarge(f"the AMF has more than {self._settings.max_vertices} vertices")
        if self._n_triangles > self._settings.max_faces:
            raise MeshTooLarge(f"the AMF has more than {self._settings.max_faces} triangles")

    def _vertex(self, node: Any) -> None:
        place = node.find("{*}coordinates")
        found = {} if place is None else {_local(each): each for each in place}
        if not found.keys() >= {"x", "y", "z"}:
            raise UnreadableFile(f"the AMF, line {node.sourceline}: a vertex has no coordinates x, y and z")
        self._object.coordinates.extend([_real(found[axis], node) for axis in "xyz"])
        self._object.n_curved += node.find("{*}normal") is not None
        self._count(vertices=1)

    def _triangle(self, node: Any) -> None:
        found = {_local(each): (each.text or "").strip() for each in node}
        corners = [found.get(name, "") for name in ("v1", "v2", "v3")]
        if not all(corner.isdigit() for corner in corners):
            raise UnreadableFile(
                f"the AMF, line {node.sourceline}: a triangle has the corners {str(corners)[:80]}, "
                "not three indices"
            )
        self._triangles.extend([int(corner) if len(corner) < MAX_DIGITS else LARGEST for corner in corners])
        self._count(triangles=1)


def _local(node: Any) -> str:
    """The name without namespace, in lower case; empty of a comment."""
    return str(node.tag).rpartition("}")[2].lower() if isinstance(node.tag, str) else ""


def _has_text(node: Any) -> bool:
    return isinstance(node.tag, str) and bool((node.text or "").strip())


def _real(node: Any, owner: Any) -> float:
    try:
        return float(node.text)
    except (TypeError, ValueError) as error:
        word = str(node.text).strip()[:40]
        raise UnreadableFile(
            f"the AMF, line {owner.sourceline}: {word!r} where a number should be"
        ) from error
