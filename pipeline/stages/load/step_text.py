"""What the text of a STEP file says about its contents, without reading its geometry.

Source: ISO 10303-21 (clear text encoding), ISO 10303-41 (units), ISO 10303-42 (solids and surfaces).
"""

import re
from dataclasses import dataclass

from pipeline.core.errors import TruncatedFile, UnreadableFile

_SCHEMA = re.compile(rb"FILE_SCHEMA\s*\(\s*\(\s*'\s*([^'\s{]*)")
_SOLID = re.compile(
    rb"#(\d+)\s*=\s*(?:MANIFOLD_SOLID_BREP|BREP_WITH_VOIDS|FACETED_BREP)\s*\(\s*'((?:[^']|'')*)'"
)
_FACE = re.compile(rb"#(\d+)\s*=\s*(?:ADVANCED_FACE|FACE_SURFACE)\s*\(\s*'((?:[^']|'')*)'")
_SHELL = re.compile(rb"#(\d+)\s*=\s*CLOSED_SHELL\s*\(\s*'(?:[^']|'')*'\s*,\s*\(([^)]*)\)")
#: The solid of one shell, and that shell.
_SHELL_OF_SOLID = re.compile(rb"#(\d+)\s*=\s*MANIFOLD_SOLID_BREP\s*\(\s*'(?:[^']|'')*'\s*,\s*#(\d+)\s*\)")
_SURFACE = re.compile(rb"=\s*(?:SHELL_BASED_SURFACE_MODEL|FACE_BASED_SURFACE_MODEL)\s*\(")
_HIDDEN = re.compile(rb"=\s*INVISIBILITY\s*\(\s*\(([^)]*)\)")
_STYLED = re.compile(
    rb"#(\d+)\s*=\s*(?:OVER_RIDING_)?STYLED_ITEM\s*\(\s*'[^']*'\s*,\s*\([^)]*\)\s*,\s*#(\d+)"
)
_EXTERNAL = re.compile(rb"=\s*DOCUMENT_FILE\s*\(")
_CONTEXT_UNITS = re.compile(rb"GLOBAL_UNIT_ASSIGNED_CONTEXT\s*\(\s*\(([^)]*)\)")
_REFERENCE = re.compile(rb"#(\d+)")
_SI_METRE = re.compile(rb"SI_UNIT\s*\(\s*(\$|\.[A-Z]+\.)\s*,\s*\.METRE\.\s*\)")
_CONVERTED = re.compile(rb"CONVERSION_BASED_UNIT\s*\(\s*'\s*([A-Za-z]*)\s*'")
#: SI prefixes and names of converted units, as keys of `units.DECLARED`.
_PREFIXES = {b"$": "meter", b".CENTI.": "centimeter", b".MILLI.": "millimeter", b".MICRO.": "micron"}
_NAMES = {b"INCH": "inch", b"IN": "inch", b"INCHES": "inch", b"FOOT": "foot", b"FEET": "foot", b"FT": "foot"}
#: Open CASCADE gives millimetres, whatever the file's unit is.
_OTHERWISE = "millimeter"


@dataclass(frozen=True, slots=True)
class StepText:
    """unit : key of `units.DECLARED`: of the file, `millimeter` for another or several, None when it declares
    none; solid_names : of each solid; surfaces : number of models of open surfaces; external : number of
    references to other files; hidden_names : of each solid that is marked as invisible; face_names :
    of the faces of each solid, in their order; none of a solid with cavities
    """

    unit: str | None
    solid_names: tuple[str, ...]
    surfaces: int
    external: int
    hidden_names: tuple[str, ...] = ()
    face_names: tuple[tuple[str, ...], ...] = ()

    @property
    def solids(self) -> int:
        """Number of solids."""
        return len(self.solid_names)


def read_step_text(data: bytes) -> StepText:
    """Raise TruncatedFile for a file without its end, UnreadableFile for one that is no model of a part."""
    if b"END-ISO-10303-21" not in data:
        lines = data.count(b"\n") + 1
        raise TruncatedFile(
            f"the STEP ends in line {lines} without END-ISO-10303-21, which closes every file"
        )
    schema = _SCHEMA.search(data)
    if schema and schema[1].upper().startswith(b"IFC"):
        raise UnreadableFile(
            f"the STEP is a building model ({schema[1].decode(errors='replace')[:20]}), which is not read",
            remedy="export the part as STEP AP203, AP214 or AP242, or as STL",
        )
    solids = {number: _text(name) for number, name in _SOLID.findall(data)}
    marked = _hidden(data)
    hidden = tuple(name for number, name in solids.items() if number in marked)
    surfaces, external = len(_SURFACE.findall(data)), len(_EXTERNAL.findall(data))
    names = _face_names(data, list(solids))
    return StepText(_unit(data), tuple(solids.values()), surfaces, external, hidden, names)


def _text(name: bytes) -> str:
    """A string of the file; `''` in it is an apostrophe."""
    return name.decode(errors="replace").replace("''", "'")


def _face_names(data: bytes, solids: list[bytes]) -> tuple[tuple[str, ...], ...]:
    """The names of the faces of each of the `solids`, given by their numbers."""
    faces = {number: _text(name) for number, name in _FACE.findall(data)}
    if not any(faces.values()):
        return ()
    shells = {number: _REFERENCE.findall(listed) for number, listed in _SHELL.findall(data)}
    shell_of = dict(_SHELL_OF_SOLID.findall(data))
    of_solid = [shells.get(shell_of.get(solid, b""), []) for solid in solids]
    return tuple(tuple(faces.get(face, "") for face in listed) for listed in of_solid)


def _hidden(data: bytes) -> set[bytes]:
    """Numbers of the entities whose style is marked as invisible."""
    marked = {number for group in _HIDDEN.findall(data) for number in _REFERENCE.findall(group)}
    return {item for style, item in _STYLED.findall(data) if style in marked} if marked else set()


def _unit(data: bytes) -> str | None:
    """The length unit of the contexts of representations."""
    used = {number for group in _CONTEXT_UNITS.findall(data) for number in _REFERENCE.findall(group)}
    units = {_unit_of(entity) for number, entity in _length_units(data) if number in used}
    if not units:
        return None
    return units.pop() if len(units) == 1 else _OTHERWISE


def _length_units(data: bytes) -> list[tuple[bytes, bytes]]:
    """Number and text of each entity of a length unit."""
    found = []
    for match in re.finditer(rb"\bLENGTH_UNIT\s*\(", data):
        start = data.rfind(b";", 0, match.start()) + 1
        end = data.find(b";", match.end())
        entity = data[start:end]
        number, equals, body = entity.partition(b"=")
        if equals and end > 0 and (reference := _REFERENCE.search(number)):
            found.append((reference[1], body))
    return found


def _unit_of(entity: bytes) -> str:
    if converted := _CONVERTED.search(entity):
        return _NAMES.get(converted[1].upper(), _OTHERWISE)
    si = _SI_METRE.search(entity)
    return _PREFIXES.get(si[1], _OTHERWISE) if si else _OTHERWISE
