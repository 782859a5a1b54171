"""3MF of one coloured surface: unlike STL, PLY and OBJ it says that its numbers are millimetres.

3MF Core Specification 1.3 with the colour groups of the Materials and Properties Extension 1.2. Written here,
not by trimesh: that gives each object a random UUID (other bytes each time), leaves colours out, and calls a
mesh a `model`, which the specification keeps for closed solids. A scan may be open: it is a `surface`.
"""

import zipfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from pipeline.core.mesh import FloatArray, Mesh

PART = "3D/3dmodel.model"
CORE = "http://schemas.microsoft.com/3dmanufacturing/core/2015/02"
MATERIAL = "http://schemas.microsoft.com/3dmanufacturing/material/2015/02"
XML = '<?xml version="1.0" encoding="UTF-8"?>\n'
TYPES = (
    XML + '<Types xmlns="http://schemas.openxmlformats.org/package/2006/content-types">'
    '<Default Extension="rels" ContentType="application/vnd.openxmlformats-package.relationships+xml"/>'
    '<Default Extension="model" ContentType="application/vnd.ms-package.3dmanufacturing-3dmodel+xml"/>'
    "</Types>\n"
)
RELATIONS = (
    XML + '<Relationships xmlns="http://schemas.openxmlformats.org/package/2006/relationships">'
    f'<Relationship Target="/{PART}" Id="model" Type="http://schemas.microsoft.com/3dmanufacturing/2013/01/3dmodel"/>'
    "</Relationships>\n"
)
LONG_AGO = (1980, 1, 1, 0, 0, 0)  # what a zip calls no date: the same mesh gives the same bytes
ROWS = 20_000  # rows of text made at once


def write(path: Path, mesh: Mesh, colours: FloatArray, name: str) -> None:
    """mesh : with triangles; colours : (n, 3) red, green, blue in [0, 1] of its vertices; name : of the
    object
    """
    if mesh.is_cloud:
        raise ValueError("3MF has no points without triangles")
    with zipfile.ZipFile(path, "w") as archive:
        for part, text in (("[Content_Types].xml", TYPES), ("_rels/.rels", RELATIONS)):
            archive.writestr(_entry(part), text)
        with archive.open(_entry(PART), "w", force_zip64=True) as stream:
            for piece in _model(mesh, colours, name):
                stream.write(piece.encode())


def _entry(part: str) -> zipfile.ZipInfo:
    entry = zipfile.ZipInfo(part, LONG_AGO)
    entry.compress_type = zipfile.ZIP_DEFLATED
    return entry


def _model(mesh: Mesh, colours: FloatArray, name: str) -> Iterator[str]:
    used, colour_of_vertex = np.unique(np.rint(255 * colours).astype(np.uint8), axis=0, return_inverse=True)
    yield XML + f'<model unit="millimeter" xml:lang="en" xmlns="{CORE}" xmlns:m="{MATERIAL}"><resources>'
    yield '<m:colorgroup id="1">'
    yield "".join('<m:color color="#{:02X}{:02X}{:02X}"/>'.format(*each) for each in used.tolist())
    yield f'</m:colorgroup><object id="2" name="{name}" type="surface" pid="1" pindex="0"><mesh><vertices>'
    yield from _rows(
        '<vertex x="{!r}" y="{!r}" z="{!r}"/>', mesh.vertices
    )  # the shortest text of the very number
    yield "</vertices><triangles>"
    corners = np.column_stack([mesh.faces, colour_of_vertex.ravel()[mesh.faces]])
    yield from _rows('<triangle v1="{}" v2="{}" v3="{}" p1="{}" p2="{}" p3="{}"/>', corners)
    yield '</triangles></mesh></object></resources><build><item objectid="2"/></build></model>\n'


def _rows(form: str, table: npt.NDArray[Any]) -> Iterator[str]:
    for start in range(0, len(table), ROWS):
        yield "".join(form.format(*row) for row in table[start : start + ROWS].tolist())
