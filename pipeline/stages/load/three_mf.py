"""3MF: what its <build> section prints, without supports, modifiers and other meshes that are not the part.

The format is that of the 3MF core specification 1.3 and the production extension 1.1; the settings of slicers
that say what a mesh is for are in `three_mf_roles`. Colours, materials, textures and slices are not used.
"""

from pipeline.core.errors import UnreadableFile
from pipeline.core.results import Note
from pipeline.core.settings import LoadSettings
from pipeline.stages.load.contents import Contents
from pipeline.stages.load.three_mf_build import Builder, Plate
from pipeline.stages.load.three_mf_left_out import EMPTY, NOT_BUILT, NOT_PRINTABLE, listed
from pipeline.stages.load.three_mf_package import Package
from pipeline.stages.load.three_mf_roles import read_roles

#: Types of objects that are the part. A file without any `model` may hold an open mesh as `surface`: those of
#: FreeCAD 0.21, and our own aligned.3mf.
SOLID, SURFACE = frozenset({"model"}), frozenset({"model", "surface"})
ON_PLATE = "place the part on the plate, save the 3MF again, or export the part as STL"


def read_three_mf(data: bytes, settings: LoadSettings) -> Contents:
    """One body for each mesh of each build item, in the unit and frame of the root model.

    Notes: `left_out_of_3mf` for each kind of mesh that is not the part; `several_parts` where more than one
    build item is.

    Raises
    ------
    UnreadableFile, TruncatedFile, IndexOutOfRange, MeshTooLarge, UnitUnknown
        With part, line and object.
    """
    package = Package(data, settings)
    builder = Builder(package, read_roles(package), settings)
    root = builder.root
    if not root.items:
        package.refuse_gcode()
        raise UnreadableFile(
            f"the <build> section of {root.part} in the 3MF is empty: "
            f"it defines {len(root.objects)} objects and prints none",
            remedy=ON_PLATE,
        )
    plate = builder.build(SOLID)
    if not plate.bodies:
        plate = builder.build(SURFACE)
    if not plate.bodies:
        package.refuse_gcode()
        raise _nothing(plate)
    for name, triangles in builder.unused():
        if triangles:
            plate.left_out.add(NOT_BUILT, name, triangles)
    notes = [*_several(plate.items), *plate.left_out.notes()]
    return Contents(tuple(plate.bodies), root.unit, tuple(notes))


def _several(items: list[str]) -> list[Note]:
    if len(items) < 2:
        return []
    numbered = [f"{number} {name}" for number, name in enumerate(items, start=1)]
    return [
        Note(
            code="several_parts",
            detail=f"the 3MF: {len(items)} parts are on the plate ({listed(numbered)}), and all of them are "
            "read as one part, in their positions on the plate; for one of them, save it alone",
        )
    ]


def _nothing(plate: Plate) -> UnreadableFile:
    found = plate.left_out.phrases()
    if set(plate.left_out.found) <= {EMPTY}:
        return UnreadableFile("the 3MF prints no triangles: the objects that it builds are empty")
    remedy = "make the part an object of type model (in a slicer: a normal part), and save the 3MF again"
    if set(plate.left_out.found) == {NOT_PRINTABLE}:
        remedy = "mark the part as printable in the slicer, and save the 3MF again"
    return UnreadableFile(f"the 3MF prints no part, only {', '.join(found)}", remedy=remedy)
