"""The header of a PLY: its elements with their properties.

The format is that of Turk, "The PLY Polygon File Format", 1994, with the type names of its later writers.
"""

from dataclasses import dataclass, field

import numpy as np

from pipeline.core.errors import TruncatedFile, UnreadableFile

#: Names of the scalar types: those of Turk, those with sizes, and the 64 bit integers of some writers.
TYPES: dict[str, str] = {
    "char": "i1",
    "uchar": "u1",
    "short": "i2",
    "ushort": "u2",
    "int": "i4",
    "uint": "u4",
    "float": "f4",
    "double": "f8",
    "int8": "i1",
    "uint8": "u1",
    "int16": "i2",
    "uint16": "u2",
    "int32": "i4",
    "uint32": "u4",
    "int64": "i8",
    "uint64": "u8",
    "float32": "f4",
    "float64": "f8",
}
ENCODINGS = {"ascii": "=", "binary_little_endian": "<", "binary_big_endian": ">"}
FORMAT_LINE = f"its second line is format NAME 1.0, with the name {' or '.join(ENCODINGS)}"
#: Elements and properties of a file. Chosen by hand: Gaussian splats with features have some hundreds.
MAX_PROPERTIES = 10_000
#: Properties of a vertex that are its position.
COORDINATES = ("x", "y", "z")


@dataclass(frozen=True, slots=True)
class Property:
    """item : type of the value, or of each item of a list; count : type of a list's length, None of a scalar;
    both in the byte order of the file
    """

    name: str
    item: np.dtype[np.generic]
    count: np.dtype[np.generic] | None = None


@dataclass(frozen=True, slots=True)
class Element:
    """rows : announced, which need not be there"""

    name: str
    rows: int
    properties: list[Property] = field(default_factory=list)

    @property
    def listed(self) -> str:
        """Names of the properties, for errors."""
        return ", ".join(each.name for each in self.properties[:20]) or "none"

    @property
    def has_lists(self) -> bool:
        """Whether the rows may differ in length."""
        return any(each.count is not None for each in self.properties)

    def find(self, *names: str) -> Property | None:
        """The first property with one of these names, upper or lower case."""
        return next((each for each in self.properties if each.name.lower() in names), None)


@dataclass(frozen=True, slots=True)
class Header:
    """is_ascii : numbers as text; elements : in the order of their data; info : `obj_info` lines, word by
    word; size : bytes, the data starts there; lines : of the header
    """

    is_ascii: bool
    elements: list[Element]
    info: list[list[str]]
    size: int
    lines: int

    def find(self, name: str) -> Element | None:
        """The element with this name, upper or lower case."""
        return next((each for each in self.elements if each.name.lower() == name), None)


def read_header(data: bytes) -> Header:
    """The header at the start of `data`, its lines ended by LF, CRLF or CR.

    Raises
    ------
    TruncatedFile
        When the file ends within it.
    UnreadableFile
        With the line that is wrong.
    """
    ended_by_cr = data[3:4] == b"\r" and data[4:5] != b"\n"
    line_end = b"\r" if ended_by_cr else b"\n"
    order: str | None = None
    elements: list[Element] = []
    names: set[str] = set()
    info: list[list[str]] = []
    at, number, defined = 0, 0, 0
    while True:
        if at >= len(data):
            raise TruncatedFile(f"the PLY ends inside its header: {number} lines, and no end_header line")
        end = data.find(line_end, at)
        end = len(data) if end < 0 else end
        words = data[at:end].decode("utf-8", errors="replace").split()
        at, number = end + 1, number + 1
        if words[:1] == ["property"] and order is None:
            raise UnreadableFile(
                f"line {number} of the PLY is a property before the format line; {FORMAT_LINE}"
            )
        defined += words[:1] in (["element"], ["property"])
        if defined > MAX_PROPERTIES:
            raise UnreadableFile(
                f"the header of the PLY has more than {MAX_PROPERTIES} elements and properties"
            )
        match words:
            case [] | ["ply" | "comment", *_]:
                pass
            case ["obj_info", *rest]:
                info.append(rest)
            case ["format", *rest]:
                order = _order(rest, number)
            case ["element", name, rows] if rows.isascii() and rows.isdigit() and len(rows) < 20:
                if name in names:
                    raise UnreadableFile(f"line {number} of the PLY defines the element {name!r} again")
                names.add(name)
                elements.append(Element(name, int(rows)))
            case ["property", *rest] if elements and order is not None:
                elements[-1].properties.append(_property(rest, elements[-1], order, number))
            case ["end_header"]:
                break
            case _:
                raise UnreadableFile(
                    f"line {number} of the PLY is no line of a header: {_shown(' '.join(words))}"
                )
    if order is None:
        raise UnreadableFile(f"the header of the PLY has no format line; {FORMAT_LINE}")
    return Header(order == "=", elements, info, min(at, len(data)), number)


def _order(words: list[str], number: int) -> str:
    """Byte order of a format line, `=` of ASCII."""
    order = ENCODINGS.get(words[0].lower()) if words else None
    if order is None or len(words) > 2:
        raise UnreadableFile(
            f"line {number} of the PLY names the format {_shown(' '.join(words))}; "
            f"known are {', '.join(ENCODINGS)}"
        )
    if len(words) == 2 and words[1].split(".")[0] != "1":
        raise UnreadableFile(f"line {number} of the PLY: version {_shown(words[1])}; known is 1.0")
    return order


def _property(words: list[str], element: Element, order: str, number: int) -> Property:
    match words:
        case ["list", count, item, name] if count.lower() in TYPES and item.lower() in TYPES:
            if TYPES[count.lower()].startswith("f"):
                raise UnreadableFile(f"line {number} of the PLY counts a list in {count}, no integer type")
            made = Property(name, _dtype(item, order), _dtype(count, order))
        case [item, name] if item.lower() in TYPES:
            made = Property(name, _dtype(item, order))
        case _:
            raise UnreadableFile(
                f"line {number} of the PLY is no property: {_shown(' '.join(words))}; "
                f"its form is TYPE NAME or list TYPE TYPE NAME, the types are {', '.join(TYPES)}"
            )
    if made.name.lower() in COORDINATES and element.find(made.name.lower()) is not None:
        raise UnreadableFile(f"line {number} of the PLY defines {made.name!r} of {element.name} again")
    return made


def _dtype(name: str, order: str) -> np.dtype[np.generic]:
    return np.dtype(order + TYPES[name.lower()])


def _shown(text: str) -> str:
    """Text of a file in an error: its start, without unprintable characters."""
    return repr(text[:40]) + ("..." if len(text) > 40 else "")
