"""A housing cover: 1.5 mm walls, stiffening ribs, screw bosses, cut-outs for a plug and a cable, vents."""

from dataclasses import dataclass, replace
from functools import lru_cache

from pipeline.core.mesh import Mesh
from tests.support.variants import solids
from tests.support.variants.dimensions import HOLE_MOVES, Dimensions

#: Thickness of walls and floor, mm: usual for printed and for moulded housings.
WALL_MM = 1.5
#: Thickness of ribs, mm: thinner than the wall, as moulding asks for.
RIB_MM = 1.2


@dataclass(frozen=True, slots=True)
class Cover:
    """Floor on z = 0, open upwards; nearly its own mirror image in y but for boss, plug and cable."""

    length_mm: float
    width_mm: float
    height_mm: float
    corner_mm: float
    cable_radius_mm: float
    vents: int
    cable_shift_mm: float = 0.0
    has_cable_hole: bool = True
    has_rib: bool = True
    has_boss: bool = True

    @classmethod
    def sampled(cls, seed: int) -> "Cover":
        """Dimensions drawn for `seed`."""
        draw = Dimensions("cover", seed)
        return cls(
            length_mm=draw.mm(66, 96),
            width_mm=draw.mm(46, 62),
            height_mm=draw.mm(15, 24),
            corner_mm=draw.mm(6, 9),
            cable_radius_mm=draw.mm(2.8, 3.8),
            vents=4 + seed % 3,
        )

    def mesh(self) -> Mesh:
        """The part, closed."""
        return _built(self)

    def changes(self) -> "dict[str, Cover]":
        """The same part with one feature changed, by the name of the change."""
        size_mm = self.mesh().diagonal_mm
        moved = {name: replace(self, cable_shift_mm=share * size_mm) for name, share in HOLE_MOVES.items()}
        return {
            **moved,
            "hole filled": replace(self, has_cable_hole=False),
            "rib missing": replace(self, has_rib=False),
            "boss missing": replace(self, has_boss=False),
        }


@lru_cache(maxsize=64)
def _built(part: Cover) -> Mesh:
    length, width, height = part.length_mm, part.width_mm, part.height_mm
    outer = solids.rounded_rectangle((0.0, 0.0), (length, width), (part.corner_mm,) * 4)
    inner = solids.rounded_rectangle(
        (WALL_MM, WALL_MM), (length - WALL_MM, width - WALL_MM), (part.corner_mm - WALL_MM,) * 4
    )
    solid = [solids.cup(outer, inner, 0.0, WALL_MM, height)]
    inset, floor, half_wall = part.corner_mm, 0.5 * WALL_MM, 0.5 * WALL_MM
    corners = [(x, y) for x in (inset, length - inset) for y in (inset, width - inset)]
    bosses = [*corners, (0.58 * length, 0.36 * width)] if part.has_boss else corners
    solid += [solids.cylinder(centre, 3.4, floor, 0.8 * height) for centre in bosses]
    ribs = (0.34, 0.77) if part.has_rib else (0.77,)
    for share in ribs:
        x = share * length
        solid.append(
            solids.block((x, half_wall, floor), (x + RIB_MM, width - half_wall, WALL_MM + 0.35 * height))
        )
    middle = 0.5 * width + 0.3
    solid.append(
        solids.block((half_wall, middle, floor), (length - half_wall, middle + RIB_MM, 0.22 * height))
    )
    cuts = [solids.cylinder(centre, 1.3, WALL_MM + 1.0, height) for centre in bosses]
    plug = (0.52 * width, 0.52 * width + 11.0)
    cuts.append(solids.block((length - 2.9, plug[0], 0.42 * height), (length + 1.0, plug[1], 0.8 * height)))
    for number in range(part.vents):
        x = 0.11 * length + 4.1 * number
        outline = solids.slot((x, 0.26 * width), (x, 0.42 * width), 0.8)
        cuts.append(solids.prism(outline, -1.0, 0.3 * height))
    if part.has_cable_hole:
        x = 0.52 * length + part.cable_shift_mm
        # (z, x) of the hole, as `z_to_y` expects it
        hole = solids.cylinder((0.58 * height, x), part.cable_radius_mm, -1.0, WALL_MM + 1.0)
        cuts.append(solids.z_to_y(hole))
    return solids.carved(solid, cuts)
