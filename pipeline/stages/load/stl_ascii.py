"""ASCII STL: facets in their usual form many at a time, all others word by word."""

from dataclasses import dataclass, field

import numpy as np

from pipeline.core.errors import MeshTooLarge, UnreadableFile
from pipeline.core.mesh import FloatArray, IndexArray
from pipeline.core.results import Note
from pipeline.core.settings import LoadSettings
from pipeline.stages.load.contents import Body, Contents
from pipeline.stages.load.number_text import parsed, without_commas
from pipeline.stages.load.polygons import triangulated
from pipeline.stages.load.stl_words import CommaInNumber, Words, numbers_of

#: Bytes of text that are read at a time.
BLOCK_BYTES = 1 << 20
#: Words of a facet in its usual form, and where its coordinates are.
FACET = b"facet normal 0 0 0 outer loop vertex 0 0 0 vertex 0 0 0 vertex 0 0 0 endloop endfacet".split()
CORNERS = [8, 9, 10, 12, 13, 14, 16, 17, 18]
DECIMAL_COMMA = Note(
    code="decimal_comma",
    detail="the STL has decimal commas (1,5); they are read as decimal points, nothing is lost",
)


@dataclass(slots=True)
class Solid:
    """corners, counts : of each run of facets, (k, 3) positions and the corners of each facet"""

    name: str
    corners: list[FloatArray] = field(default_factory=list)
    counts: list[IndexArray] = field(default_factory=list)

    def add(self, corners: FloatArray, counts: IndexArray) -> None:
        self.corners.append(corners)
        self.counts.append(counts)

    @property
    def body(self) -> Body:
        """Its triangles."""
        vertices = np.concatenate([np.zeros((0, 3)), *self.corners])
        counts = np.concatenate([np.zeros(0, dtype=np.int64), *self.counts])
        corners = np.arange(len(vertices), dtype=np.int64)
        if (counts == 3).all():
            return Body(vertices, corners.reshape(-1, 3), self.name)
        finite = np.isfinite(vertices)
        with np.errstate(all="ignore"):  # what is not finite or too far away is reported for the mesh
            return Body(vertices, triangulated(np.where(finite, vertices, 0.0), corners, counts), self.name)


def read_ascii_stl(data: bytes, settings: LoadSettings) -> Contents:
    """One body for each solid with facets, with its name.

    Raises
    ------
    TruncatedFile, UnreadableFile, MeshTooLarge
        With the line.
    """
    data = data.rstrip(b"\0\x1a\r\n\t ")  # \x1a: the end of a text of DOS
    notes: tuple[Note, ...] = ()
    try:
        solids = _solids(data, settings)
    except CommaInNumber as comma:
        data, is_decimal = without_commas(data, numbers_of(data), "STL", comma.line)
        notes = (DECIMAL_COMMA,) if is_decimal else ()
        try:
            solids = _solids(data, settings)
        except CommaInNumber as again:
            raise UnreadableFile(
                f"line {again.line} of the STL has more than one comma in a number",
                remedy="export the file with spaces between the numbers",
            ) from None
    return Contents(tuple(solid.body for solid in solids if solid.counts), notes=notes)


def _solids(data: bytes, settings: LoadSettings) -> list[Solid]:
    words = Words(data)
    solids: list[Solid] = []
    triangles, careful = 0, 0
    is_open = False
    while True:
        if is_open and words.at >= careful:
            corners, used = _usual(data, words.at)
            careful = words.at + (used or BLOCK_BYTES)
            if used:
                solids[-1].add(corners, np.full(len(corners) // 3, 3, dtype=np.int64))
                triangles += len(corners) // 3
                words.at += used
                _check_number(triangles, settings)
                continue
        match words.keyword():
            case "":
                break
            case "solid":
                solids.append(Solid(words.name()))
                is_open = True
            case "endsolid":
                words.name()
                is_open = False
            case "facet":
                if not is_open:  # `solid` is missing
                    solids.append(Solid(""))
                    is_open = True
                corners = words.facet()
                solids[-1].add(corners, np.array([len(corners)]))
                triangles += max(len(corners) - 2, 0)
                _check_number(triangles, settings)
            case "color" | "colour":
                words.name()
            case _:
                raise words.unexpected("facet, endsolid or solid")
    return solids


def _usual(data: bytes, at: int) -> tuple[FloatArray, int]:
    """(3 f, 3) corners of the facets from byte `at` on, and their bytes; 0 if one has another form."""
    limit = data.find(b"endsolid", at, at + BLOCK_BYTES)
    end = data.rfind(b"endfacet", at, limit if limit >= 0 else at + BLOCK_BYTES)
    if end < 0 or data[end + len(b"endfacet") : end + len(b"endfacet") + 1].strip():
        return np.zeros((0, 3)), 0
    end += len(b"endfacet")
    words = data[at:end].split()
    k = len(FACET)
    if len(words) % k:
        return np.zeros((0, 3)), 0
    for column, expected in enumerate(FACET):
        if expected != b"0" and words[column::k].count(expected) != len(words) // k:
            return np.zeros((0, 3)), 0
    numbers: list[bytes] = [b""] * (len(words) // k * len(CORNERS))
    for place, column in enumerate(CORNERS):
        numbers[place :: len(CORNERS)] = words[column::k]
    values, stopped = parsed(b" ".join(numbers), len(numbers))
    return (np.zeros((0, 3)), 0) if stopped is not None else (values.reshape(-1, 3), end - at)


def _check_number(triangles: int, settings: LoadSettings) -> None:
    if triangles > settings.max_faces:
        raise MeshTooLarge(f"more than {settings.max_faces} triangles, which is the limit")
