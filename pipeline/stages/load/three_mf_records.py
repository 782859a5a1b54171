"""One model part of a 3MF as records: objects, components and build items, each with its place in the XML."""

from dataclasses import dataclass, field

import numpy as np

from pipeline.core.errors import IndexOutOfRange
from pipeline.core.mesh import FloatArray, IndexArray
from pipeline.stages.load.three_mf_roles import Range
from pipeline.stages.load.three_mf_xml import line_of


@dataclass(frozen=True, slots=True)
class Place:
    """The `ordinal`-th element `name` of a part, for messages: its line is looked up only for these."""

    part: str
    name: str
    ordinal: int

    def text(self, data: bytes) -> str:
        """data : the part's content"""
        return f"{self.part} in the 3MF, line {line_of(data, self.name, self.ordinal)}"


@dataclass(frozen=True, slots=True, eq=False)
class Use:
    """A component or a build item: an object, and where it goes. path : of the part that has the object, None
    for the same part; transform : (4, 3), row vectors: p' = (p, 1) @ transform
    """

    object_id: str
    path: str | None
    transform: FloatArray
    printable: bool
    place: Place


@dataclass(slots=True, eq=False)
class Object:
    """kind : its type; vertices : (n, 3) float64 in the unit of the part; faces : (m, 3) int64; first_face :
    number of triangles of the part before it; ranges : triangles with a role; role : of all, None of a part;
    unread : geometry other than triangles
    """

    object_id: str
    kind: str
    name: str
    first_face: int
    vertices: FloatArray = field(default_factory=lambda: np.zeros((0, 3)))
    faces: IndexArray = field(default_factory=lambda: np.zeros((0, 3), dtype=np.int64))
    components: list[Use] = field(default_factory=list)
    ranges: list[Range] = field(default_factory=list)
    role: str | None = None
    unread: list[str] = field(default_factory=list)


@dataclass(frozen=True, slots=True, eq=False)
class Model:
    """part : its name in the package; unit : as declared; objects : by id, in their order"""

    part: str
    unit: str
    objects: dict[str, Object]
    items: list[Use]


def wrong_face(part: str, data: bytes, thing: Object, limit: int) -> IndexOutOfRange:
    """The error for the first triangle of an object that refers to a vertex not below `limit`."""
    outside = (thing.faces < 0) | (thing.faces >= limit)
    face, corner = np.argwhere(outside)[0]
    line = line_of(data, "triangle", thing.first_face + int(face))
    return IndexOutOfRange(
        f"{part} in the 3MF, line {line}: triangle {face} of object {thing.object_id} refers to vertex "
        f"{thing.faces[face, corner]}, but the object has {limit} vertices, counted from 0"
    )
