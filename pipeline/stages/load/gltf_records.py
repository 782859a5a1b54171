"""The JSON of a glTF 2.0, as far as it places triangles and points. Names of fields are those of the file.

Source: glTF 2.0 specification, section 5 (properties reference).
"""

from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field

Index = Annotated[int, Field(ge=0)]
Real = Annotated[float, Field(allow_inf_nan=False)]
Extensions = dict[str, Any]
#: Type of a component: its name in numpy, little-endian (table of section 3.6.2.2).
COMPONENTS = {5120: "<i1", 5121: "<u1", 5122: "<i2", 5123: "<u2", 5125: "<u4", 5126: "<f4"}
POINTS, TRIANGLES, STRIP, FAN = 0, 4, 5, 6


class Record(BaseModel):
    model_config = ConfigDict(frozen=True, extra="ignore")

    name: str = ""
    extensions: Extensions = {}


class Asset(Record):
    version: str
    minVersion: str | None = None  # noqa: N815


class Buffer(Record):
    byteLength: Index  # noqa: N815
    uri: str | None = None


class BufferView(Record):
    buffer: Index
    byteLength: Index  # noqa: N815
    byteOffset: Index = 0  # noqa: N815
    byteStride: Index = 0  # noqa: N815


class SparseIndices(Record):
    bufferView: Index  # noqa: N815
    byteOffset: Index = 0  # noqa: N815
    componentType: int  # noqa: N815


class SparseValues(Record):
    bufferView: Index  # noqa: N815
    byteOffset: Index = 0  # noqa: N815


class Sparse(Record):
    count: Index
    indices: SparseIndices
    values: SparseValues


class Accessor(Record):
    componentType: int  # noqa: N815
    count: Index
    type: str
    bufferView: Index | None = None  # noqa: N815
    byteOffset: Index = 0  # noqa: N815
    normalized: bool = False
    sparse: Sparse | None = None


class Primitive(Record):
    attributes: dict[str, Index]
    indices: Index | None = None
    mode: Literal[0, 1, 2, 3, 4, 5, 6] = 4
    targets: list[dict[str, Any]] = []


class GltfMesh(Record):
    primitives: list[Primitive]


class Node(Record):
    mesh: Index | None = None
    skin: Index | None = None
    children: list[Index] = []
    matrix: Annotated[list[Real], Field(min_length=16, max_length=16)] | None = None
    translation: tuple[Real, Real, Real] = (0.0, 0.0, 0.0)
    rotation: tuple[Real, Real, Real, Real] = (0.0, 0.0, 0.0, 1.0)
    scale: tuple[Real, Real, Real] = (1.0, 1.0, 1.0)


class Skin(Record):
    joints: list[Index]
    inverseBindMatrices: Index | None = None  # noqa: N815


class Scene(Record):
    nodes: list[Index] = []


class Document(Record):
    asset: Asset
    accessors: list[Accessor] = []
    bufferViews: list[BufferView] = []  # noqa: N815
    buffers: list[Buffer] = []
    meshes: list[GltfMesh] = []
    nodes: list[Node] = []
    skins: list[Skin] = []
    scenes: list[Scene] = []
    scene: Index | None = None
    extensionsUsed: list[str] = []  # noqa: N815
    extensionsRequired: list[str] = []  # noqa: N815
