"""What the rows of a PLY element are read as, from text and from binary data alike."""

from dataclasses import dataclass
from typing import Any, Protocol

import numpy.typing as npt

from pipeline.core.errors import TruncatedFile
from pipeline.core.mesh import FloatArray, IndexArray
from pipeline.stages.load.ply_header import Element, Property


@dataclass(frozen=True, slots=True, eq=False)
class ListColumn:
    """items : (sum of counts,) numbers, row after row; counts : (n,) items of each row"""

    items: npt.NDArray[Any]
    counts: IndexArray


class Rows(Protocol):
    """The rows of one element, all of them in the file."""

    def scalars(self, wanted: list[Property]) -> FloatArray:
        """(n, len(wanted)) values of scalar properties."""
        ...

    def lists(self, wanted: Property) -> ListColumn:
        """Values of a list property."""
        ...


def truncated(element: Element, rows: int, where: str = "") -> TruncatedFile:
    """The file ends before all rows of an element; `rows` are there in full."""
    place = f": {where}" if where else ""
    return TruncatedFile(f"the PLY announces {element.rows} {element.name} rows and has {rows}{place}")
