"""An angle bracket: base and upright plate, fillet, gusset rib, holes, and a boss with a hole."""

from dataclasses import dataclass, replace
from functools import lru_cache
from math import pi

import numpy as np

from pipeline.core.mesh import FloatArray, Mesh
from tests.support.variants import solids
from tests.support.variants.dimensions import HOLE_MOVES, Dimensions

#: Overlap of two solids that are united, mm, so that no faces coincide.
OVERLAP_MM = 0.7


@dataclass(frozen=True, slots=True)
class Bracket:
    """Base on z = 0 along x, upright on x = 0; `rib_y_mm` is off the middle, the boss on one side only."""

    length_mm: float
    width_mm: float
    height_mm: float
    thickness_mm: float
    fillet_mm: float
    rib_y_mm: float
    rib_thickness_mm: float
    hole_radius_mm: float
    first_hole_shift_mm: float = 0.0
    has_first_hole: bool = True
    has_rib: bool = True
    has_boss: bool = True

    @classmethod
    def sampled(cls, seed: int) -> "Bracket":
        """Dimensions drawn for `seed`."""
        draw = Dimensions("bracket", seed)
        width = draw.mm(40, 54)
        return cls(
            length_mm=draw.mm(58, 84),
            width_mm=width,
            height_mm=draw.mm(44, 66),
            thickness_mm=draw.mm(5, 8),
            fillet_mm=draw.mm(4, 8),
            rib_y_mm=round(width * draw.share(0.43, 0.47), 1),
            rib_thickness_mm=draw.mm(3.5, 5),
            hole_radius_mm=draw.mm(2.6, 3.4),
        )

    @property
    def hole_volume_mm3(self) -> float:
        """Volume of the first hole, a cylinder."""
        return pi * self.hole_radius_mm**2 * self.thickness_mm

    def mesh(self) -> Mesh:
        """The part, closed."""
        return _built(self)

    def changes(self) -> "dict[str, Bracket]":
        """The same part with one feature changed, by the name of the change."""
        size_mm = self.mesh().diagonal_mm
        moved = {
            name: replace(self, first_hole_shift_mm=-share * size_mm) for name, share in HOLE_MOVES.items()
        }
        return {
            **moved,
            "hole filled": replace(self, has_first_hole=False),
            "rib missing": replace(self, has_rib=False),
            "boss missing": replace(self, has_boss=False),
        }


@lru_cache(maxsize=64)
def _built(part: Bracket) -> Mesh:
    length, width, height, t = part.length_mm, part.width_mm, part.height_mm, part.thickness_mm
    rounding = 0.15 * width
    boss_y, boss_z, boss_radius = 0.74 * width, 0.66 * height, 0.13 * width
    base = solids.rounded_rectangle((0.0, 0.0), (length, width), (rounding, 0.0, 0.0, rounding))
    upright = solids.rounded_rectangle((0.0, 0.0), (width, height), (rounding, rounding, 0.0, 0.0))
    solid = [solids.prism(base, 0.0, t), solids.z_to_x(solids.prism(upright, 0.0, t))]
    solid.append(solids.prism_along_y(_fillet(t, part.fillet_mm), 0.0, width))
    if part.has_rib:
        reach, top, low = 0.52 * length, 0.72 * height, t - OVERLAP_MM
        rib = np.array([[low, low], [t + reach, low], [t + reach, t + 1.5], [t + 1.5, top], [low, top]])
        half = part.rib_thickness_mm / 2
        solid.append(solids.prism_along_y(rib, part.rib_y_mm - half, part.rib_y_mm + half))
    if part.has_boss:
        boss = solids.cylinder((boss_y, boss_z), boss_radius, t - OVERLAP_MM, t + 0.14 * length)
        solid.append(solids.z_to_x(boss))
    cuts = [
        solids.z_to_x(solids.cylinder((boss_y, boss_z), 0.5 * boss_radius, -1.0, t + 0.3 * length)),
        solids.z_to_x(solids.cylinder((0.23 * width, 0.7 * height), 0.1 * width, -1.0, t + 1.0)),
        solids.cylinder((0.74 * length, 0.78 * width), part.hole_radius_mm, -1.0, t + 1.0),
        solids.cylinder((0.45 * length, 0.8 * width), 1.6, -1.0, t + 1.0),
    ]
    if part.has_first_hole:
        centre = (0.74 * length + part.first_hole_shift_mm, 0.2 * width)
        cuts.append(solids.cylinder(centre, part.hole_radius_mm, -1.0, t + 1.0))
    return solids.carved(solid, cuts)


def _fillet(t: float, radius: float) -> FloatArray:
    """(n, 2) outline in (x, z) of the inner fillet at (t, t), seen whole from its first corner."""
    low, end = t - OVERLAP_MM, t + radius
    angle = np.linspace(1.5 * pi, pi, 13)
    arc = end + radius * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    return np.concatenate([[[low, low], [end, low]], arc, [[low, end]]])
