"""Header and content of an OFF."""

import re
from dataclasses import dataclass

import numpy as np

from pipeline.core.errors import IndexOutOfRange, TruncatedFile, UnreadableFile
from pipeline.core.formats import Format
from pipeline.core.mesh import FloatArray, IndexArray

_KEYWORD = re.compile(
    rb"(?:\s|#[^\n]*\n)*((?:ST|[CN4n]){0,5})OFF(?:[^\S\n]+(BINARY)\b[^\n]*\n)?",
)


@dataclass(frozen=True, slots=True)
class Header:
    """The keyword: what each vertex has. n_dimensions : whether the file names the dimension; start : of what
    follows the keyword
    """

    texture: bool
    colour: bool
    normal: bool
    homogeneous: bool
    n_dimensions: bool
    binary: bool
    start: int

    @property
    def coordinates(self) -> int:
        return 4 if self.homogeneous else 3

    @property
    def width(self) -> int:
        """Numbers of a vertex: coordinates, normal, colour, texture coordinates."""
        return self.coordinates + 3 * self.normal + 4 * self.colour + 2 * self.texture


@dataclass(frozen=True, slots=True, eq=False)
class Polygons:
    """vertices : (n, 3); vertex_lines : (n,) of a text; corners : (sum of counts,), from 0; counts : (f,);
    trailing : what follows the last face; decimal_comma : vertices that are written with one
    """

    vertices: FloatArray
    vertex_lines: IndexArray | None
    corners: IndexArray
    counts: IndexArray
    trailing: str = ""
    decimal_comma: int = 0


def read_header(data: bytes) -> Header:
    """The keyword at the start of the file.

    Raises
    ------
    UnreadableFile
        When there is none.
    """
    match = _KEYWORD.match(data)
    if match is None:
        raise UnreadableFile(f"the {Format.OFF} does not start with the word OFF")
    # MeshLab writes NCOFF: in another order than the manual
    texture, colour, normal, homogeneous, n_dimensions = (
        letters in match[1] for letters in (b"ST", b"C", b"N", b"4", b"n")
    )
    return Header(texture, colour, normal, homogeneous, n_dimensions, match[2] is not None, match.end())


def check_dimension(header: Header, dimension: int) -> None:
    """Raise UnreadableFile for an nOFF whose vertices are not points in space."""
    if header.homogeneous or dimension != 3:
        name = "4nOFF" if header.homogeneous else "nOFF"
        raise UnreadableFile(
            f"the {Format.OFF} is {name} with vertices of {dimension} dimensions; only 3 are read",
            remedy="export the part as OFF with x, y and z of each vertex",
        )


def check_counts(vertices: int, faces: int) -> None:
    """Raise UnreadableFile for negative counts."""
    if vertices < 0 or faces < 0:
        raise UnreadableFile(f"the {Format.OFF} announces {vertices} vertices and {faces} faces")


def truncated(announced: tuple[int, int], present: tuple[int, int]) -> TruncatedFile:
    """The error of a file that ends early."""
    return TruncatedFile(
        f"the {Format.OFF} announces {announced[0]} vertices and {announced[1]} faces, "
        f"and has {present[0]} and {present[1]}"
    )


def in_space(coordinates: FloatArray) -> FloatArray:
    """(n, 3) of homogeneous coordinates (n, 4), or of (n, 3).

    Raises
    ------
    UnreadableFile
        When a vertex lies at infinity.
    """
    if coordinates.shape[1] == 3:
        return coordinates
    infinite = np.flatnonzero(coordinates[:, 3] == 0)
    if infinite.size:
        raise UnreadableFile(
            f"vertex {infinite[0]} (the first is 0) of the 4{Format.OFF} has the homogeneous coordinate 0: "
            "it lies at infinity"
        )
    with np.errstate(over="ignore", invalid="ignore"):
        return np.asarray(coordinates[:, :3] / coordinates[:, 3:])


def check_indices(corners: IndexArray, counts: IndexArray, n_vertices: int, lines: IndexArray | None) -> None:
    """Raise IndexOutOfRange for a face with a vertex that does not exist."""
    outside = np.flatnonzero((corners < 0) | (corners >= n_vertices))
    if outside.size:
        face = int(np.searchsorted(np.cumsum(counts), outside[0], side="right"))
        place = "" if lines is None else f", on line {lines[face]},"
        raise IndexOutOfRange(
            f"face {face} (the first is 0) of the {Format.OFF}{place} refers to vertex "
            f"{corners[outside[0]]}, but there are {n_vertices}, counted from 0"
        )
