"""The XML section of an E57: which scans there are, their poses, and how their points are stored.

Source: ASTM E2807-11, sections 6 and 8.4.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
from lxml import etree  # type: ignore[import-untyped]

from pipeline.core.errors import UnreadableFile
from pipeline.core.mesh import FloatArray
from pipeline.stages.load.e57_points import FieldType
from pipeline.stages.load.three_mf_xml import OPTIONS

NAMESPACE = "http://www.astm.org/COMMIT/E57/2010-e57-v1.0"
INT64_MIN, INT64_MAX = -(2**63), 2**63 - 1
KINDS = ("Float", "Integer", "ScaledInteger", "String")
#: Length of a quaternion below which it is no rotation.
MIN_QUATERNION = 1e-9


@dataclass(frozen=True, slots=True, eq=False)
class Scan:
    """label : for messages; points_at : offset in the file; quaternion : (4,) w, x, y, z; translation : (3,)
    m; has_pose : whether the file gives one
    """

    label: str
    name: str
    points_at: int
    count: int
    fields: list[FieldType]
    quaternion: FloatArray
    translation: FloatArray
    has_pose: bool

    @property
    def has_zero_rotation(self) -> bool:
        """Whether the rotation is written, and is none."""
        return not float(np.linalg.norm(self.quaternion)) > MIN_QUATERNION

    @property
    def has_rotation(self) -> bool:
        """Whether the pose turns the points."""
        return self.has_pose and not self.has_zero_rotation

    @property
    def has_position(self) -> bool:
        """Whether the pose says where the scanner stood. The identity is also written of points in the frame
        of the file, whose scanner is not known.
        """
        return self.has_pose and not (
            np.allclose(self.translation, 0) and abs(self.quaternion[0]) >= np.linalg.norm(self.quaternion)
        )


def read_scans(xml: bytes) -> list[Scan]:
    """Raise UnreadableFile when the XML is damaged or has no scans."""
    if b"<!DOCTYPE" in xml or b"<!ENTITY" in xml:
        raise UnreadableFile("the XML section of the E57 declares a document type or entities")
    try:
        root = etree.fromstring(xml.rstrip(b"\0"), etree.XMLParser(**OPTIONS))
    except (etree.XMLSyntaxError, ValueError) as error:
        raise UnreadableFile(f"the XML section of the E57 is damaged ({str(error)[:150]})") from error
    data = _child(root, "data3D")
    scans = [_scan(node, number) for number, node in enumerate(data if data is not None else [], start=1)]
    if not scans:
        raise UnreadableFile("the E57 has no scans", remedy="export the points, not only pictures")
    return scans


def _scan(node: Any, number: int) -> Scan:
    name = _text(_child(node, "name"))
    label = f"scan {number}" + (f" ({name[:40]})" if name else "")
    points = _child(node, "points")
    if points is None:
        raise UnreadableFile(f"{label} of the E57 has no points")
    pose = _child(node, "pose")
    rotation, translation = (
        (None, None) if pose is None else (_child(pose, "rotation"), _child(pose, "translation"))
    )
    quaternion = np.array([1.0, 0, 0, 0])
    if rotation is not None:
        quaternion = np.array([_number(_child(rotation, axis), label) for axis in "wxyz"])
    shift = np.zeros(3)
    if translation is not None:
        shift = np.array([_number(_child(translation, axis), label) for axis in "xyz"])
    prototype = _child(points, "prototype")
    fields = [] if prototype is None else [_field(each, label) for each in prototype.iter() if _is_leaf(each)]
    return Scan(
        label,
        name,
        _integer(points.get("fileOffset"), label, 0, 0),
        _integer(points.get("recordCount"), label, 0, 0),
        fields,
        quaternion,
        shift,
        pose is not None,
    )


def _is_leaf(node: Any) -> bool:
    return isinstance(node.tag, str) and node.get("type") in KINDS


def _field(node: Any, label: str) -> FieldType:
    namespace, _, name = node.tag.rpartition("}")
    own = name if namespace in (f"{{{NAMESPACE}", "") else ""
    kind = node.get("type")
    scale, offset = (
        _real(node.get(key), default, label) for key, default in (("scale", 1.0), ("offset", 0.0))
    )
    lowest, highest = (
        _integer(node.get(key), label, default) if kind in ("Integer", "ScaledInteger") else 0
        for key, default in (("minimum", INT64_MIN), ("maximum", INT64_MAX))
    )
    if highest < lowest:
        raise UnreadableFile(f"the points of {label} of the E57 have {name[:40]} of no range")
    return FieldType(own, kind, 4 if node.get("precision") == "single" else 8, lowest, highest, scale, offset)


def _child(node: Any, name: str) -> Any:
    return node.find(f"{{*}}{name}")


def _text(node: Any) -> str:
    return "" if node is None else (node.text or "").strip()


def _number(node: Any, label: str) -> float:
    """Of the pose. An empty element is zero (section 8.4.3)."""
    return 0.0 if node is None else _real(_text(node) or None, 0.0, label)


def _real(text: str | None, default: float, label: str) -> float:
    try:
        value = default if text is None else float(text)
    except ValueError:
        value = np.nan
    if not np.isfinite(value):
        raise UnreadableFile(f"{label} of the E57 has {str(text)[:40]!r} where a number should be")
    return value


def _integer(text: str | None, label: str, default: int, lowest: int = INT64_MIN) -> int:
    try:
        value = default if text is None else int(text)
    except ValueError:
        value = INT64_MAX + 1
    if not lowest <= value <= INT64_MAX:
        raise UnreadableFile(f"{label} of the E57 has {str(text)[:40]!r} where an integer should be")
    return value
