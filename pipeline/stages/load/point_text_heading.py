"""The heading of a point text: which columns are x, y and z, and their unit."""

import csv
import re
from dataclasses import dataclass

from pipeline.core.errors import UnreadableFile
from pipeline.stages.load.point_text_lines import shown

_AXIS = "{0} {0}coordinate {0}coordinates {0}coord coordinate{0} coord{0} {0}pos pos{0} {0}position "
_AXIS += "position{0} point{0} vertex{0} cartesian{0} {0}koordinate {0}wert {0}value location{0}"
#: Names of each axis; the first that a heading has counts. Names are compared without case, spaces and
#: punctuation, so `Points:0` (ParaView) is points0.
NAMES: tuple[tuple[frozenset[str], ...], ...] = tuple(
    (frozenset(_AXIS.format(letter).split()), frozenset({f"points{place}", f"point{place}"}), others)
    for place, (letter, others) in enumerate(
        [
            ("x", frozenset({"easting", "east", "eastings", "rechtswert"})),
            ("y", frozenset({"northing", "north", "northings", "hochwert"})),
            ("z", frozenset({"height", "elevation", "elev", "altitude", "alt", "höhe", "hoehe", "up"})),
        ]
    )
)
#: Words for units, and the keys of `units.DECLARED`.
UNITS = {
    "mm": "millimeter",
    "millimeter": "millimeter",
    "millimeters": "millimeter",
    "millimetre": "millimeter",
    "millimetres": "millimeter",
    "cm": "centimeter",
    "centimeter": "centimeter",
    "centimeters": "centimeter",
    "centimetre": "centimeter",
    "centimetres": "centimeter",
    "m": "meter",
    "meter": "meter",
    "meters": "meter",
    "metre": "meter",
    "metres": "meter",
    "in": "inch",
    "inch": "inch",
    "inches": "inch",
    '"': "inch",
    "ft": "foot",
    "foot": "foot",
    "feet": "foot",
    "um": "micron",
    "µm": "micron",
    "μm": "micron",
    "micron": "micron",
    "microns": "micron",
}
#: x[mm], x (mm), x_mm, x/mm, x in mm
_UNIT = re.compile(
    r"([^\[({<]+)[\[({<]([^\])}>]*)[\])}>]?"
    r"|(.*?[^_/ ])(?: in |[_/ ])(mm|cm|m|inch|inches|µm|μm|um|ft)"
)
_PREFIX = re.compile(r"(?:columns?|fields?|format|header|heading|spalten)\s*[:=]\s*", re.IGNORECASE)
_TWO_WORDS = re.compile(
    r"\b(points?|pt|scan|row|line|normal|color|colour|scalar)\s+(id|no\.?|nr\.?|number|name|index|field|[xyzrgb])\b",
    re.IGNORECASE,
)


@dataclass(frozen=True, slots=True)
class Heading:
    """columns : of x, y and z, from 0; names : of all columns; unit : a key of `units.DECLARED`, another
    word that the heading has as unit, or None; partial : only some of x, y and z have the unit
    """

    columns: tuple[int, int, int]
    names: tuple[str, ...]
    unit: str | None
    partial: bool = False


def heading_of(line: bytes, delimiter: str, n_columns: int) -> Heading | None:
    """What a line says as heading of that many columns; None where it has another number of names, or none
    of x, y and z.

    Raises
    ------
    UnreadableFile
        When two columns have the name of one axis, or x, y and z have different units.
    """
    for names in _splits(_text(line), delimiter):
        if len(names) == n_columns:
            found = _columns(names, line)
            if found is not None:
                return _with_unit(found, names, line)
    return None


def words_of(line: bytes) -> list[str]:
    """The words of a line, without the mark of a comment."""
    return re.split(r"[\s,;|]+", _text(line).strip(" ,;|\t"))


def axes_first(line: bytes) -> bool:
    """Whether a line starts with the names of x, y and z, in this order."""
    words = words_of(line)
    return len(words) >= 3 and _columns(words[:3], line) == (0, 1, 2)


def _text(line: bytes) -> str:
    try:
        text = line.decode("utf-8")
    except UnicodeDecodeError:
        text = line.decode("latin-1")
    return _PREFIX.sub("", text.strip().lstrip("#/%!;").strip(), count=1)


def _splits(text: str, delimiter: str) -> list[list[str]]:
    """The names by each delimiter that the text has, that of the rows first; by spaces last."""
    splits = []
    for mark in dict.fromkeys([delimiter, ";", "|", "\t", ","]):
        if mark != " " and mark in text:
            names = next(csv.reader([text], delimiter=mark, skipinitialspace=True), [])
            splits += [names, names[:-1]] if names and not names[-1].strip() else [names]
    joined = re.sub(r"\s+(?=[\[(][^\])]*[\])])", "", text)
    for form in (joined, _TWO_WORDS.sub(r"\1_\2", joined)):
        words = re.findall(r'"[^"]*"|[^\s,;|"]+', form)
        splits.append(words)
    return splits


def _columns(names: list[str], line: bytes) -> tuple[int, int, int] | None:
    plain = [re.sub(r"[\W_]", "", _parts(name)[0]) for name in names]
    found = []
    for axis in NAMES:
        places: list[int] = []
        for family in axis:
            places = places or [at for at, name in enumerate(plain) if name in family]
        if not places:
            return None
        if len(places) > 1:
            raise UnreadableFile(
                f"the heading names {len(places)} columns {names[places[0]].strip()!r} or alike: "
                f"{shown(line)}",
                remedy="name one column x, one y and one z",
            )
        found.append(places[0])
    x, y, z = found
    return x, y, z


def _parts(name: str) -> tuple[str, str | None]:
    """Name and unit of a column, in lower case."""
    plain = name.strip(" \t'\"").lower()
    match = _UNIT.fullmatch(plain)
    if match is None:
        return plain, None
    return (match[1] or match[3]).strip(" _"), (match[2] or match[4] or "").strip(" .") or None


def _with_unit(columns: tuple[int, int, int], names: list[str], line: bytes) -> Heading:
    stated = [_parts(names[at])[1] for at in columns]
    words = [word for word in stated if word is not None and not word.isdigit()]
    units = {UNITS.get(word, word) for word in words}
    if len(units) > 1:
        raise UnreadableFile(
            f"the heading gives x, y and z different units: {shown(line)}",
            remedy="write x, y and z in one unit",
        )
    whole = len(words) == 3
    unit = units.pop() if units and whole else None
    return Heading(columns, tuple(name.strip() for name in names), unit, bool(words) and not whole)
