"""Arrays of a glTF 2.0: accessors, with strides, normalized integers and sparse values.

Source: glTF 2.0 specification, section 3.6.2; KHR_mesh_quantization.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from pipeline.core.errors import IndexOutOfRange, MeshTooLarge, TruncatedFile, UnreadableFile
from pipeline.core.formats import Format
from pipeline.core.mesh import FloatArray, IndexArray
from pipeline.core.settings import LoadSettings
from pipeline.stages.load.gltf_container import Container
from pipeline.stages.load.gltf_records import COMPONENTS, Accessor

WIDTHS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT4": 16}


@dataclass(frozen=True, slots=True, eq=False)
class Accessors:
    """Reads the accessors of a file."""

    container: Container
    settings: LoadSettings

    def has_data(self, index: int) -> bool:
        """Whether the accessor exists and refers to bytes; without any, its values are 0."""
        accessors = self.container.document.accessors
        return index < len(accessors) and accessors[index].bufferView is not None

    def count(self, index: int, where: str) -> int:
        """Number of values, without reading them."""
        return self._accessor(index, where).count

    def floats(self, index: int, where: str, kind: str, rows: IndexArray | None = None) -> FloatArray:
        """(n, width) float64: normalized integers as numbers from -1 or 0 to 1, others as they are; of some
        rows only where given.

        Raises
        ------
        TruncatedFile, UnreadableFile, IndexOutOfRange, MeshTooLarge
            With accessor and place.
        """
        accessor = self._accessor(index, where)
        values = self._values(accessor, f"accessor {index} ({where})", kind)
        numbers = (values if rows is None else values[rows]).astype(np.float64)
        if accessor.normalized and values.dtype.kind in "iu":
            # section 3.6.2.2: the most negative integer is -1 as well
            numbers = np.maximum(numbers / np.iinfo(values.dtype).max, -1.0)
        return np.asarray(numbers)

    def integers(self, index: int, where: str, kind: str = "SCALAR") -> IndexArray:
        """(n, width) int64 of unsigned integers. Raises as `floats`."""
        accessor = self._accessor(index, where)
        values = self._values(accessor, f"accessor {index} ({where})", kind)
        if values.dtype.kind != "u":
            raise UnreadableFile(
                f"accessor {index} ({where}) of the {Format.GLB} has components of type "
                f"{accessor.componentType}, which are no unsigned integers"
            )
        return values.astype(np.int64)

    def bytes_of_view(self, index: int, where: str) -> bytes:
        """All bytes of a buffer view. Raises as `floats`."""
        views = self.container.document.bufferViews
        length = views[index].byteLength if index < len(views) else 0
        return self._view(index, 0, length, 1, np.dtype("u1"), where).tobytes()

    def is_normalized(self, index: int, where: str) -> bool:
        """Whether integers stand for numbers from -1 or 0 to 1."""
        return self._accessor(index, where).normalized

    def _accessor(self, index: int, where: str) -> Accessor:
        accessors = self.container.document.accessors
        if index >= len(accessors):
            raise IndexOutOfRange(
                f"{where} of the {Format.GLB} refers to accessor {index}, but there are {len(accessors)}"
            )
        return accessors[index]

    def _values(self, accessor: Accessor, where: str, kind: str) -> npt.NDArray[Any]:
        """(n, width) in the type of the file."""
        if accessor.type != kind:
            raise UnreadableFile(f"{where} of the {Format.GLB} has type {accessor.type[:20]!r}, not {kind}")
        limit = self.settings.max_vertices
        if accessor.count > limit:
            raise MeshTooLarge(
                f"{where} of the {Format.GLB} has {accessor.count} values; the limit is {limit}"
            )
        width, dtype = WIDTHS[kind], _dtype(accessor.componentType, where)
        if accessor.bufferView is None:
            values = np.zeros((accessor.count, width), dtype=dtype)
        else:
            values = self._view(accessor.bufferView, accessor.byteOffset, accessor.count, width, dtype, where)
        if accessor.sparse is not None:
            values = values.copy()
            sparse, count = accessor.sparse, accessor.sparse.count
            chosen = self._view(
                sparse.indices.bufferView,
                sparse.indices.byteOffset,
                count,
                1,
                _dtype(sparse.indices.componentType, where),
                f"sparse indices of {where}",
            )[:, 0]
            if chosen.dtype.kind != "u":
                raise UnreadableFile(
                    f"sparse indices of {where} of the {Format.GLB} are no unsigned integers"
                )
            if count and int(chosen.max()) >= accessor.count:
                raise IndexOutOfRange(
                    f"sparse indices of {where} of the {Format.GLB} refer to value {chosen.max()}, "
                    f"but there are {accessor.count}"
                )
            new = sparse.values
            values[chosen] = self._view(
                new.bufferView, new.byteOffset, count, width, dtype, f"sparse values of {where}"
            )
        return values

    def _view(
        self, index: int, offset: int, count: int, width: int, dtype: np.dtype[Any], where: str
    ) -> npt.NDArray[Any]:
        views = self.container.document.bufferViews
        if index >= len(views):
            raise IndexOutOfRange(
                f"{where} of the {Format.GLB} refers to buffer view {index}, but there are {len(views)}"
            )
        view = views[index]
        buffer = self.container.buffer(view.buffer, f"buffer view {index}")
        size = width * dtype.itemsize
        stride = view.byteStride or size
        if stride < size:
            raise UnreadableFile(
                f"{where} of the {Format.GLB}: the values have {size} bytes each, but a stride of {stride}"
            )
        if view.byteOffset + view.byteLength > len(buffer):
            raise TruncatedFile(
                f"buffer view {index} of the {Format.GLB} ends at byte {view.byteOffset + view.byteLength}, "
                f"but its buffer has {len(buffer)}"
            )
        end = offset + (stride * (count - 1) + size if count else 0)
        if end > view.byteLength:
            raise TruncatedFile(
                f"{where} of the {Format.GLB} ends at byte {end} of buffer view {index}, "
                f"which has {view.byteLength}"
            )
        return np.ndarray(
            (count, width),
            dtype=dtype,
            buffer=buffer,
            offset=view.byteOffset + offset if count else 0,
            strides=(stride, dtype.itemsize),
        )


def _dtype(component: int, where: str) -> np.dtype[Any]:
    if component not in COMPONENTS:
        raise UnreadableFile(
            f"{where} of the {Format.GLB} has components of type {component}, which glTF 2.0 does not have"
        )
    return np.dtype(COMPONENTS[component])
