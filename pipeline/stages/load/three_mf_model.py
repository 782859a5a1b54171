"""Reads one model part of a 3MF: its objects and its build items (3MF core specification 1.3, chapters 3 and
4; production extension 1.1 for `path`).
"""

import io
from array import array
from typing import Any

import numpy as np
from lxml import etree  # type: ignore[import-untyped]

from pipeline.core.errors import IndexOutOfRange, UnreadableFile
from pipeline.stages.load.three_mf_blocks import MARK, cut
from pipeline.stages.load.three_mf_extensions import refuse_unread
from pipeline.stages.load.three_mf_records import Model, Object, Place, Use
from pipeline.stages.load.three_mf_roles import Range
from pipeline.stages.load.three_mf_xml import OPTIONS, line_of, not_well_formed

#: Elements of extensions that define geometry of an object, and what they are.
UNREAD_GEOMETRY = {
    "beamlattice": "beam lattice",
    "booleanshape": "boolean shape",
    "levelset": "level set",
    "displacementmesh": "displacement mesh",
}
#: Settings of a mesh in a Cura project that make it something else than a part.
CURA_ROLES = {
    "cura:anti_overhang_mesh": "support blocker",
    "cura:support_mesh": "support enforcer",
    "cura:cutting_mesh": "modifier",
    "cura:infill_mesh": "modifier",
}


def read_model(part: str, data: bytes) -> Model:
    """Read the XML of a model part.

    Raises
    ------
    TruncatedFile, UnreadableFile, IndexOutOfRange
        With part, line and object.
    """
    if b"<!DOCTYPE" in data:
        raise UnreadableFile(f"{part} in the 3MF has a DTD, which the 3MF specification forbids")
    try:
        _, root = next(etree.iterparse(io.BytesIO(data), events=("start",), **OPTIONS))
        tag, attributes, namespaces = root.tag, dict(root.attrib), dict(root.nsmap)
        namespace, _, local = tag.rpartition("}")
        if local != "model":
            raise UnreadableFile(f"{part} in the 3MF is no model: its root element is <{local}>")
        refuse_unread(part, attributes.get("requiredextensions", ""), namespaces)
        unit = attributes.get("unit", "millimeter").strip().lower()
        rows = cut(data)
        if rows is not None:
            try:
                return _built(_Builder(part, data, namespace, rows.tables), rows.skeleton, unit)
            except etree.XMLSyntaxError:
                pass  # it is one of the whole as well, which has the line
        return _built(_Builder(part, data, namespace, []), data, unit)
    except (etree.XMLSyntaxError, StopIteration) as error:
        raise not_well_formed(part, data, error) from error


def _built(builder: "_Builder", xml: bytes, unit: str) -> Model:
    etree.fromstring(xml, etree.XMLParser(target=builder, **OPTIONS))
    return Model(builder.part, unit, builder.objects, builder.items)


class _Builder:
    """Target of the XML parser. data : the whole part, for lines of errors; namespace : `{uri` of the core
    elements; tables : rows that were taken out of the XML
    """

    def __init__(self, part: str, data: bytes, namespace: str, tables: list[Any]) -> None:
        self.part, self.objects, self.items = part, dict[str, Object](), list[Use]()
        self._data, self._tables = data, tables
        self._object: Object | None = None
        self._vertices, self._faces = array("d"), array("q")
        self._n_faces = 0
        self._counts: dict[str, int] = {}
        self._key, self._text = "", ""
        head = namespace + "}" if namespace else ""
        self._starts = {
            head + "vertex": self._vertex,
            head + "triangle": self._triangle,
            head + "vertices": self._table,
            head + "triangles": self._table,
            head + "object": self._start_object,
            head + "component": self._component,
            head + "item": self._item,
            head + "metadata": self._metadata,
        }
        self._object_tag, self._metadata_tag = head + "object", head + "metadata"

    def start(self, tag: str, attributes: Any) -> None:
        handle = self._starts.get(tag)
        if handle is not None:
            handle(attributes)
        elif self._object is not None:
            self._foreign(self._object, tag.rpartition("}")[2], attributes)

    def end(self, tag: str) -> None:
        if tag == self._object_tag and self._object is not None:
            if self._vertices:
                self._object.vertices = np.array(self._vertices).reshape(-1, 3)
            if self._faces:
                self._object.faces = np.array(self._faces, dtype=np.int64).reshape(-1, 3)
            self._n_faces += len(self._object.faces)
            self._vertices, self._faces = array("d"), array("q")
            self._object = None
        elif tag == self._metadata_tag and self._key:
            if self._object is not None and self._text.strip().lower() in ("true", "1"):
                self._object.role = CURA_ROLES[self._key]
            self._key = ""

    def data(self, text: str) -> None:
        if self._key:
            self._text += text

    def doctype(self, *_: Any) -> None:
        raise UnreadableFile(f"{self.part} in the 3MF has a DTD, which the 3MF specification forbids")

    def close(self) -> None:
        pass

    def _vertex(self, attributes: Any) -> None:
        try:
            self._vertices.extend((float(attributes["x"]), float(attributes["y"]), float(attributes["z"])))
        except (KeyError, ValueError) as error:
            raise self._bad_row("vertex", len(self._vertices) // 3, error) from error

    def _triangle(self, attributes: Any) -> None:
        try:
            self._faces.extend((int(attributes["v1"]), int(attributes["v2"]), int(attributes["v3"])))
        except OverflowError as error:
            raise IndexOutOfRange(f"{self._row('triangle', len(self._faces) // 3)} has no index") from error
        except (KeyError, ValueError) as error:
            raise self._bad_row("triangle", len(self._faces) // 3, error) from error

    def _row(self, name: str, number: int) -> str:
        before = (
            sum(len(each.vertices) for each in self.objects.values()) if name == "vertex" else self._n_faces
        )
        line = line_of(self._data, name, before + number)
        owner = self._object.object_id if self._object else "?"
        return f"{self.part} in the 3MF, line {line}: {name} {number} of object {owner}"

    def _bad_row(self, name: str, number: int, error: Exception) -> UnreadableFile:
        fault = f"has no {error.args[0]}" if isinstance(error, KeyError) else f"has a bad number ({error})"
        return UnreadableFile(f"{self._row(name, number)} {fault}")

    def _table(self, attributes: Any) -> None:
        number = attributes.get(MARK)
        if number is None or self._object is None:
            return
        table = self._tables[int(number)]
        if table.dtype == np.float64:
            self._object.vertices = table
        else:
            self._object.faces = table

    def _start_object(self, attributes: Any) -> None:
        place = self._place("object")
        object_id = attributes.get("id", "").strip()
        if not object_id:
            raise UnreadableFile(f"{place.text(self._data)}: the object has no id")
        if object_id in self.objects:
            raise UnreadableFile(f"{place.text(self._data)}: a second object has the id {object_id}")
        kind = attributes.get("type", "").strip().lower() or "model"
        self._object = Object(object_id, kind, attributes.get("name", "").strip(), self._n_faces)
        self.objects[object_id] = self._object
        if _local(attributes, "slicestackid") is not None:
            self._object.unread.append("slices")

    def _component(self, attributes: Any) -> None:
        use = self._use("component", attributes)
        if self._object is not None:
            self._object.components.append(use)

    def _item(self, attributes: Any) -> None:
        self.items.append(self._use("item", attributes))

    def _use(self, name: str, attributes: Any) -> Use:
        place = self._place(name)
        object_id = attributes.get("objectid", "").strip()
        if not object_id:
            raise UnreadableFile(f"{place.text(self._data)}: the {name} has no objectid")
        text = attributes.get("transform", "1 0 0 0 1 0 0 0 1 0 0 0")
        try:
            transform = np.array([float(word) for word in text.split()]).reshape(4, 3)
        except ValueError as error:
            raise UnreadableFile(
                f"{place.text(self._data)}: the transform {text[:80]!r} is not 12 numbers"
            ) from error
        if not np.isfinite(transform).all() or np.linalg.det(transform[:3]) == 0:
            raise UnreadableFile(f"{place.text(self._data)}: the transform {text[:80]!r} has no inverse")
        printable = (_local(attributes, "printable") or "1").strip().lower() not in ("0", "false")
        return Use(object_id, _local(attributes, "path"), transform, printable, place)

    def _place(self, name: str) -> Place:
        ordinal = self._counts.get(name, 0)
        self._counts[name] = ordinal + 1
        return Place(self.part, name, ordinal)

    def _metadata(self, attributes: Any) -> None:
        name = attributes.get("name", "")
        if self._object is not None and name in CURA_ROLES:
            self._key, self._text = name, ""

    def _foreign(self, thing: Object, local: str, attributes: Any) -> None:
        """An element of an extension within an object."""
        if local in UNREAD_GEOMETRY:
            thing.unread.append(UNREAD_GEOMETRY[local])
        elif local == "volume" and "ts" in attributes and "te" in attributes:  # Slic3r 1.3
            role = "modifier" if attributes.get("modifier") == "1" else None
            try:
                thing.ranges.append(Range(int(attributes["ts"]), int(attributes["te"]), role))
            except ValueError as error:
                raise UnreadableFile(
                    f"{self.part} in the 3MF: a volume of object {thing.object_id} has a bad number ({error})"
                ) from error


def _local(attributes: Any, name: str) -> str | None:
    """The value of an attribute of any namespace."""
    for key, value in attributes.items():
        if key.rpartition("}")[2] == name:
            return str(value)
    return None
