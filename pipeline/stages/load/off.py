"""OFF of Geomview, as text or binary: its polygons as triangles, or its points. Colours, normals and texture
coordinates are not used.

Source: Geomview manual 1.9, section 4.2.5.
"""

import numpy as np

from pipeline.core.errors import UnreadableFile
from pipeline.core.formats import Format, as_utf8
from pipeline.core.results import Note
from pipeline.core.settings import LoadSettings
from pipeline.stages.load.contents import Body, Contents
from pipeline.stages.load.off_binary import read_binary
from pipeline.stages.load.off_records import Polygons, read_header
from pipeline.stages.load.off_text import read_text
from pipeline.stages.load.text_polygons import check_finite, check_size, triangles_of


def read_off(data: bytes, settings: LoadSettings) -> Contents:
    """One body with all vertices, in the order of the file; a cloud where there are no faces.

    Notes: `left_out_of_off`, `decimal_comma`.

    Raises
    ------
    TruncatedFile, UnreadableFile, IndexOutOfRange, NotFinite, MeshTooLarge
        With the line or the face.
    """
    data = as_utf8(data)
    header = read_header(data)
    found = read_binary(data, header) if header.binary else read_text(data, header)
    if not len(found.vertices):
        raise UnreadableFile(f"the {Format.OFF} has no vertices")
    check_size(len(found.vertices), found.counts, settings)
    check_finite(found.vertices, np.arange(len(found.vertices)), found.vertex_lines, Format.OFF)
    triangles = triangles_of(found.vertices, found.corners, found.counts)
    if len(found.counts) and not len(triangles):
        raise UnreadableFile(
            f"the {len(found.counts)} faces of the {Format.OFF} have fewer than 3 corners each",
            remedy="export the surface as a mesh of triangles or polygons",
        )
    return Contents((Body(found.vertices, triangles),), notes=_notes(found))


def _notes(found: Polygons) -> tuple[Note, ...]:
    short, notes = int((found.counts < 3).sum()), []
    if short:
        what = "1 face" if short == 1 else f"{short} faces"
        notes.append(
            Note(
                code="left_out_of_off",
                detail=f"the {Format.OFF}: {what} with fewer than 3 corners left out: no area, no effect",
            )
        )
    if found.trailing:
        notes.append(
            Note(
                code="left_out_of_off",
                detail=f"the {Format.OFF}: {found.trailing} after the last of the {len(found.counts)} "
                "announced faces left out; if they are faces, the part is incomplete",
            )
        )
    if found.decimal_comma:
        notes.append(
            Note(
                code="decimal_comma",
                detail=f"the {Format.OFF}: the numbers of {found.decimal_comma} vertices are written with a "
                "comma, which was read as a decimal point",
            )
        )
    return tuple(notes)
