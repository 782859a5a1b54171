"""Writes one coloured surface as 3MF, which, unlike STL, PLY and OBJ, states the unit (millimetres).

3MF Core Specification 1.3 with the colour groups of the Materials and Properties Extension 1.2. trimesh is
not used: it gives each object a random UUID (different bytes each time), omits colours, and writes the object
type `model`, which the specification reserves for closed solids. A scan may be open, so its type is
`surface`.
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
    f'<Relationship Target="/{PART}" Id="model" '
    'Type="http://schemas.microsoft.com/3dmanufacturing/2013/01/3dmodel"/>'
    "</Relationships>\n"
)
#: Date of the zip entries, the earliest that the format allows; fixed, so the same mesh gives the same bytes.
ZIP_DATE = (1980, 1, 1, 0, 0, 0)
#: Rows of text formatted at once; affects only memory and time.
ROWS = 20_000


def write(path: Path, mesh: Mesh, colours: FloatArray, name: str) -> None:
    """Write a mesh with triangles. colours : (n, 3) RGB in [0, 1] of the vertices; name : name of the object

    Raises
    ------
    ValueError
        When the mesh is a point cloud.
    """
    if mesh.is_cloud:
        raise ValueError("3MF cannot store a point cloud")
    with zipfile.ZipFile(path, "w") as archive:
        for part, text in (("[Content_Types].xml", TYPES), ("_rels/.rels", RELATIONS)):
            archive.writestr(_entry(part), text)
        with archive.open(_entry(PART), "w", force_zip64=True) as stream:
            for piece in _model(mesh, colours, name):
                stream.write(piece.encode())


def _entry(part: str) -> zipfile.ZipInfo:
    entry = zipfile.ZipInfo(part, ZIP_DATE)
    entry.compress_type = zipfile.ZIP_DEFLATED
    return entry


def _model(mesh: Mesh, colours: FloatArray, name: str) -> Iterator[str]:
    rgb = np.rint(255 * colours).astype(np.uint8)
    distinct, colour_of_vertex = np.unique(rgb, axis=0, return_inverse=True)
    yield XML + f'<model unit="millimeter" xml:lang="en" xmlns="{CORE}" xmlns:m="{MATERIAL}"><resources>'
    yield '<m:colorgroup id="1">'
    yield "".join('<m:color color="#{:02X}{:02X}{:02X}"/>'.format(*each) for each in distinct.tolist())
    yield f'</m:colorgroup><object id="2" name="{name}" type="surface" pid="1" pindex="0"><mesh><vertices>'
    # repr gives the shortest text that reads back as the same number.
    yield from _rows('<vertex x="{!r}" y="{!r}" z="{!r}"/>', mesh.vertices)
    yield "</vertices><triangles>"
    corners = np.column_stack([mesh.faces, colour_of_vertex.ravel()[mesh.faces]])
    yield from _rows('<triangle v1="{}" v2="{}" v3="{}" p1="{}" p2="{}" p3="{}"/>', corners)
    yield '</triangles></mesh></object></resources><build><item objectid="2"/></build></model>\n'


def _rows(form: str, table: npt.NDArray[Any]) -> Iterator[str]:
    for start in range(0, len(table), ROWS):
        yield "".join(form.format(*row) for row in table[start : start + ROWS].tolist())
