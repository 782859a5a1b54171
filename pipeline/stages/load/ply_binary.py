"""The rows of a binary PLY: by strides where all rows are alike, else by the start of each."""

import struct
from array import array
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from pipeline.core.errors import UnreadableFile
from pipeline.core.mesh import FloatArray, IndexArray
from pipeline.stages.load.ply_columns import ListColumn, truncated
from pipeline.stages.load.ply_header import Element, Header, Property

Dtype = np.dtype[np.generic]
#: How `struct` calls an integer type of numpy.
CODES = {"i1": "b", "u1": "B", "i2": "h", "u2": "H", "i4": "i", "u4": "I", "i8": "q", "u8": "Q"}


@dataclass(frozen=True, slots=True, eq=False)
class AlikeRows:
    """Rows of `size` bytes from byte `first`; lengths : items of each property, 1 of a scalar"""

    data: bytes
    element: Element
    first: int
    size: int
    lengths: tuple[int, ...]

    def scalars(self, wanted: list[Property]) -> FloatArray:
        """(n, len(wanted)) values of scalar properties."""
        out = np.zeros((self.element.rows, len(wanted)))
        with np.errstate(invalid="ignore"):  # a NaN may be a signalling one
            for column, each in enumerate(wanted):
                out[:, column] = self._column(self._offset(each), each.item)
        return out

    def lists(self, wanted: Property) -> ListColumn:
        """Values of a list property."""
        n, length = self.element.rows, self._length(wanted)
        counts = np.full(n, length, dtype=np.int64)
        if n * length == 0:
            return ListColumn(np.zeros(0, dtype=wanted.item), counts)
        first = self.first + self._offset(wanted) + _head(wanted)
        view: npt.NDArray[Any] = np.ndarray(
            (n, length), wanted.item, self.data, first, (self.size, wanted.item.itemsize)
        )
        return ListColumn(view.astype(wanted.item.newbyteorder("=")).ravel(), counts)

    def _column(self, offset: int, item: Dtype) -> npt.NDArray[Any]:
        return _strided(self.data, self.element.rows, item, self.first + offset, self.size)

    def _length(self, wanted: Property) -> int:
        pairs = zip(self.element.properties, self.lengths, strict=True)
        return next(length for each, length in pairs if each is wanted)

    def _offset(self, wanted: Property) -> int:
        offset = 0
        for each, length in zip(self.element.properties, self.lengths, strict=True):
            if each is wanted:
                break
            offset += _head(each) + length * each.item.itemsize
        return offset


@dataclass(frozen=True, slots=True, eq=False)
class UnlikeRows:
    """starts : (n,) byte of each row"""

    data: bytes
    element: Element
    starts: IndexArray

    def scalars(self, wanted: list[Property]) -> FloatArray:
        """(n, len(wanted)) values of scalar properties."""
        with np.errstate(invalid="ignore"):
            columns = [_at(self.data, self._places(each), each.item).astype(np.float64) for each in wanted]
        return np.stack(columns, axis=1)

    def lists(self, wanted: Property) -> ListColumn:
        """Values of a list property."""
        at = self._places(wanted)
        counts = _counts(self.data, at, wanted)
        within = np.arange(int(counts.sum())) - np.repeat(np.cumsum(counts) - counts, counts)
        places = np.repeat(at + _head(wanted), counts) + within * wanted.item.itemsize
        return ListColumn(_at(self.data, places, wanted.item), counts)

    def _places(self, wanted: Property) -> IndexArray:
        """(n,) byte of a property in each row."""
        at = self.starts
        for each in self.element.properties:
            if each is wanted:
                break
            items = 1 if each.count is None else _counts(self.data, at, each)
            at = at + _head(each) + items * each.item.itemsize
        return at


def binary_rows(data: bytes, header: Header) -> dict[str, AlikeRows | UnlikeRows]:
    """The rows of each element, by its name.

    Raises
    ------
    TruncatedFile, UnreadableFile (a list of less than no items)
    """
    at = header.size
    found: dict[str, AlikeRows | UnlikeRows] = {}
    for element in header.elements:
        least = sum((each.count or each.item).itemsize for each in element.properties)
        left = len(data) - at
        if element.rows * least > left and not element.has_lists:
            rows = left // least
            raise truncated(element, rows, _place(rows, at + rows * least, data))
        alike = _alike(data, element, at)
        if alike is not None:
            found[element.name], at = alike, at + alike.size * element.rows
        else:
            found[element.name], at = _walked(data, element, at)
    return found


def _alike(data: bytes, element: Element, first: int) -> AlikeRows | None:
    """Rows that all have lists as long as those of the first row; None where one has not."""
    at, n = first, element.rows
    lengths: list[int] = []
    counted: list[tuple[int, Dtype, int]] = []
    for each in element.properties:
        if each.count is None:
            lengths.append(1)
        elif n == 0:
            lengths.append(0)
        else:
            if at + each.count.itemsize > len(data):
                return None
            lengths.append(int(_strided(data, 1, each.count, at, 0)[0]))
            counted.append((at, each.count, lengths[-1]))
        at += _head(each) + lengths[-1] * each.item.itemsize
        if lengths[-1] < 0 or (n and at > len(data)):
            return None
    size = at - first
    if first + n * size > len(data):
        return None
    for place, count, length in counted:
        if not (_strided(data, n, count, place, size) == length).all():
            return None
    return AlikeRows(data, element, first, size, tuple(lengths))


def _walked(data: bytes, element: Element, first: int) -> tuple[UnlikeRows, int]:
    """Rows one after the other, since the length of each says where the next starts; and their end."""
    least = sum((each.count or each.item).itemsize for each in element.properties)
    room = min(element.rows, (len(data) - first) // least + 1)  # what is announced need not be there
    starts = array("q", bytes(8 * (room + 1)))
    lists = [each for each in element.properties if each.count is not None]
    if len(lists) == 1 and lists[0].count == np.dtype("u1"):
        walked = _walk_short_lists(data, element, lists[0], first, starts)
    else:
        walked = _walk(data, element, first, starts)
    ends = np.frombuffer(starts, dtype=np.int64)[: walked + 1]
    whole = int(np.searchsorted(ends[1:], len(data), side="right"))
    if whole < element.rows:
        raise truncated(element, whole, _place(whole, int(ends[whole]), data))
    return UnlikeRows(data, element, ends[: element.rows]), int(ends[element.rows])


def _walk_short_lists(data: bytes, element: Element, wanted: Property, at: int, starts: "array[int]") -> int:
    """Write the start of each row and the end of the last; how many rows there are. For the usual face: one
    list, its length in a byte.
    """
    sizes_before = [each.item.itemsize for each in element.properties[: element.properties.index(wanted)]]
    before = sum(sizes_before)
    fixed = 1 + sum(each.item.itemsize for each in element.properties if each is not wanted)
    sizes = [fixed + length * wanted.item.itemsize for length in range(256)]
    starts[0] = at
    row = 0
    try:
        for row in range(len(starts) - 1):
            at += sizes[data[at + before]]
            starts[row + 1] = at
    except IndexError:
        return row
    return len(starts) - 1


def _walk(data: bytes, element: Element, at: int, starts: "array[int]") -> int:
    """As `_walk_short_lists`, for any properties."""
    steps = []
    for each in element.properties:
        order = (
            "" if each.count is None else {"=": "<", "|": "<"}.get(each.count.byteorder, each.count.byteorder)
        )
        length_of = (
            None if each.count is None else struct.Struct(order + CODES[each.count.str[1:]]).unpack_from
        )
        steps.append((length_of, _head(each), each.item.itemsize))
    starts[0] = at
    row = 0
    try:
        for row in range(len(starts) - 1):
            for length_of, head, size in steps:
                length = 1 if length_of is None else length_of(data, at)[0]
                if length < 0:
                    raise UnreadableFile(
                        f"row {row} of {element.name} in the PLY (the first is 0), at byte {starts[row]}, "
                        f"has a list of {length} items"
                    )
                at += head + length * size
                if at > len(data):
                    return row
            starts[row + 1] = at
    except struct.error:
        return row
    return len(starts) - 1


def _place(row: int, at: int, data: bytes) -> str:
    return f"row {row} (the first is 0) starts at byte {at}, and the ply file has {len(data)} bytes"


def _head(each: Property) -> int:
    """Bytes before the first item of a property."""
    return 0 if each.count is None else each.count.itemsize


def _strided(data: bytes, n: int, item: Dtype, first: int, stride: int) -> npt.NDArray[Any]:
    """(n,) values from byte `first` on, a view of the data."""
    if n == 0:
        return np.zeros(0, dtype=item)
    view: npt.NDArray[Any] = np.ndarray((n,), item, data, first, (stride,))
    return view


def _at(data: bytes, places: IndexArray, item: Dtype) -> npt.NDArray[Any]:
    """(n,) values that start at these bytes."""
    if not len(places):
        return np.zeros(0, dtype=item.newbyteorder("="))
    windows = _strided(data, len(data) - item.itemsize + 1, item, 0, 1)
    return windows[places].astype(item.newbyteorder("="), copy=False)


def _counts(data: bytes, places: IndexArray, each: Property) -> IndexArray:
    assert each.count is not None  # noqa: S101  (a list)
    return _at(data, places, each.count).astype(np.int64)
