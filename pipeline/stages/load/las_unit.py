"""The length unit of a LAS: of its coordinate reference system, as WKT or as GeoTIFF keys.

Source: LAS specification 1.4-R15, sections 2.6 and 3; OGC 01-009 and 12-063r5 (WKT); GeoTIFF 1.1,
OGC 19-008.
"""

import re
from typing import Any

from pipeline.core.errors import UnreadableFile
from pipeline.core.results import Note

#: GeoTIFF keys, and EPSG codes of units.
MODEL_TYPE, PROJECTED_SYSTEM, PROJECTED_UNIT, VERTICAL_UNIT = 1024, 3072, 3076, 4099
GEOGRAPHIC = 2
UNIT_CODES = {9001: "meter", 9002: "foot", 9003: "us survey foot"}
#: Metres of the units that are known, as WKT gives them.
METRES = {
    "meter": 1.0,
    "centimeter": 0.01,
    "millimeter": 0.001,
    "foot": 0.3048,
    "us survey foot": 1200 / 3937,
}
_WKT_UNIT = re.compile(r'(?:LENGTHUNIT|(?<![A-Z])UNIT)\s*\[\s*"([^"]*)"\s*,\s*([-+0-9.eE]+)')
_DEGREES = re.compile(r"^\s*(?:GEOGCS|GEOGCRS|GEODCRS|GEODETICCRS|GEOGRAPHICCRS)\s*\[", re.IGNORECASE)
_VERTICAL = re.compile(r"VERT_CS|VERTCRS|VERTICALCRS", re.IGNORECASE)
#: Code of the note where none is declared.
ASSUMED_UNIT = "unit_assumed"
#: Relative difference of two factors that are the same unit: foot and US survey foot differ by 2e-6.
SAME_UNIT = 1e-7


def unit_of_las(records: list[Any]) -> tuple[str | None, list[Note]]:
    """The declared unit, a key of `units.DECLARED` or a text that names an unknown one; a note where the file
    declares none.

    records : of variable length, as `laspy` reads them

    Raises
    ------
    UnreadableFile
        Where the coordinates are degrees, or heights have another unit.
    """
    for record in records:
        text = getattr(record, "string", None)
        if type(record).__name__ == "WktCoordinateSystemVlr" and text:
            return _of_wkt(str(text)), []
    for record in records:
        if type(record).__name__ == "GeoKeyDirectoryVlr":
            keys = {
                int(key.id): int(key.value_offset) for key in record.geo_keys if key.tiff_tag_location == 0
            }
            unit = _of_keys(keys)
            if unit is not None:
                return unit, []
    detail = (
        "the LAS declares no coordinate system and so no unit: its numbers were read as mm; most programs "
        "write metres: if the part comes out 1,000 times too small, set options.units to m"
    )
    return None, [Note(code="unit_assumed", detail=detail)]


def _of_keys(keys: dict[int, int]) -> str | None:
    if keys.get(MODEL_TYPE) == GEOGRAPHIC:
        raise _degrees()
    unit = _unit_code(keys[PROJECTED_UNIT]) if PROJECTED_UNIT in keys else None
    if unit and VERTICAL_UNIT in keys:
        _check_heights(unit, _unit_code(keys[VERTICAL_UNIT]))
    if unit is None and PROJECTED_SYSTEM in keys:
        return f"of the coordinate system EPSG:{keys[PROJECTED_SYSTEM]}"
    return unit


def _unit_code(code: int) -> str:
    return UNIT_CODES.get(code, f"EPSG:{code}")


def _of_wkt(text: str) -> str:
    if _DEGREES.search(text):
        raise _degrees()
    vertical = _VERTICAL.search(text)
    ground = _last_unit(text[: vertical.start()] if vertical else text)
    if vertical and (height := _last_unit(text[vertical.start() :])):
        _check_heights(ground, height)
    return ground or "of its coordinate system, which names none"


def _last_unit(text: str) -> str | None:
    """The unit of the axes: the last one, after those of angles."""
    found = _WKT_UNIT.findall(text)
    if not found:
        return None
    name, number = found[-1]
    try:
        factor = float(number)
    except ValueError:
        return str(name)
    known = [unit for unit, metres in METRES.items() if abs(factor / metres - 1) < SAME_UNIT]
    return known[0] if known else str(name)


def _check_heights(ground: str | None, height: str) -> None:
    if ground != height:
        raise UnreadableFile(
            f"the coordinates of the LAS have two units: {ground} on the ground, {height} for heights",
            remedy="export the points in one unit, for example metres",
        )


def _degrees() -> UnreadableFile:
    return UnreadableFile(
        "the coordinates of the LAS are degrees of longitude and latitude, not lengths",
        remedy="export the points in a projected or local coordinate system",
    )
