"""What slicers say about the meshes of a 3MF: which are modifiers, negative volumes or for supports.

Sources: PrusaSlicer and SuperSlicer, `Metadata/Slic3r_PE_model.config`: triangle ranges of one mesh with
`volume_type`, or `modifier` of older versions. Bambu Studio and OrcaSlicer, `Metadata/model_settings.config`:
`part` elements with `subtype`, by the object id of a component.
"""

from dataclasses import dataclass, field
from typing import Any

from lxml import etree  # type: ignore[import-untyped]

from pipeline.stages.load.three_mf_package import Package
from pipeline.stages.load.three_mf_xml import OPTIONS, not_well_formed

#: Values of `volume_type` (PrusaSlicer) and `subtype` (Bambu Studio) that are not a part, and what they are.
NOT_PRINTED = {
    "parametermodifier": "modifier",
    "negativevolume": "negative volume",
    "supportblocker": "support blocker",
    "supportenforcer": "support enforcer",
    "1": "modifier",
    "modifier_part": "modifier",
    "negative_part": "negative volume",
    "support_blocker": "support blocker",
    "support_enforcer": "support enforcer",
}


@dataclass(frozen=True, slots=True)
class Range:
    """Triangles first to last (inclusive) of a mesh; role : a value of `NOT_PRINTED`, None of a part"""

    first: int
    last: int
    role: str | None
    name: str = ""


@dataclass(frozen=True, slots=True)
class Part:
    """A component, by its object id."""

    role: str | None
    name: str = ""


@dataclass(frozen=True, slots=True)
class Roles:
    """By object id of the root model. names : of objects; ranges : of their own mesh; parts : of their
    components, by the object id of the component, in the order of the components
    """

    names: dict[str, str] = field(default_factory=dict)
    ranges: dict[str, list[Range]] = field(default_factory=dict)
    parts: dict[tuple[str, str], list[Part]] = field(default_factory=dict)

    def part(self, object_id: str, component_id: str, occurrence: int) -> Part:
        """The `occurrence`-th component of an object with this object id."""
        found = self.parts.get((object_id, component_id), [])
        return found[min(occurrence, len(found) - 1)] if found else Part(None)


def read_roles(package: Package) -> Roles:
    """The roles that the settings of slicers give.

    Raises
    ------
    TruncatedFile, UnreadableFile
        When such a settings file is damaged: without it, modifiers would be taken for parts.
    """
    roles = Roles()
    for name in package.names:
        lowered = name.lower()
        if lowered == "metadata/model_settings.config" or (
            lowered.startswith("metadata/") and lowered.endswith("_model.config")
        ):
            _read(name, package.read(name), roles)
    return roles


def _read(name: str, data: bytes, roles: Roles) -> None:
    try:
        root = etree.fromstring(data, etree.XMLParser(**OPTIONS))
    except etree.XMLSyntaxError as error:
        raise not_well_formed(name, data, error) from error
    for thing in root.iterchildren("{*}object"):
        object_id = (thing.get("id") or "").strip()
        values = _metadata(thing)
        if values.get("name"):
            roles.names[object_id] = values["name"]
        for child in thing.iterchildren("{*}volume", "{*}part"):
            values = _metadata(child)
            role = _role(child.get("subtype"), values)
            called = values.get("name", "")
            first, last = _whole(child.get("firstid")), _whole(child.get("lastid"))
            if first is not None and last is not None:
                roles.ranges.setdefault(object_id, []).append(Range(first, last, role, called))
            elif child.get("id") is not None:
                roles.parts.setdefault((object_id, child.get("id").strip()), []).append(Part(role, called))


def _metadata(element: Any) -> dict[str, str]:
    entries = element.iterchildren("{*}metadata")
    return {each.get("key"): each.get("value") or "" for each in entries if each.get("key")}


def _role(subtype: str | None, values: dict[str, str]) -> str | None:
    """The last that is said: a `volume_type` or `part_type` among the metadata counts more than `subtype`."""
    if values.get("modifier") == "1" and "volume_type" not in values:
        return "modifier"
    value = values.get("volume_type") or values.get("part_type") or subtype or ""
    return NOT_PRINTED.get(value.strip().lower())


def _whole(text: str | None) -> int | None:
    try:
        return None if text is None else int(text)
    except ValueError:
        return None
