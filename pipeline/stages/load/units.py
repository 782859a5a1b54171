"""The unit of a file's numbers, and how many millimetres it is."""

from pipeline.core.errors import UnitUnknown
from pipeline.core.settings import Unit

MM_PER_UNIT = {"mm": 1.0, "cm": 10.0, "m": 1000.0, "inch": 25.4}
#: What files may declare: 3MF (core specification, section 3.4), glTF's metre, the coordinate
#: systems of LAS; and the name in the result.
DECLARED = {
    "micron": ("micron", 0.001),
    "millimeter": ("mm", 1.0),
    "centimeter": ("cm", 10.0),
    "inch": ("inch", 25.4),
    "foot": ("foot", 304.8),
    "feet": ("foot", 304.8),
    "us survey foot": ("US survey foot", 1200000 / 3937),
    "meter": ("m", 1000.0),
}


def unit_of(requested: Unit, declared: str | None) -> tuple[str, float]:
    """The unit requested by the user; `auto` selects the declared unit of the file, or mm."""
    if requested != "auto":
        return requested, MM_PER_UNIT[requested]
    if declared is None:
        return "mm", 1.0
    if declared not in DECLARED:
        raise UnitUnknown(f"the file declares the unit {declared!r}")
    return DECLARED[declared]
