"""A flange plate: holes in a pattern, a bore, a slot, and two dowel holes that break the symmetry."""

from dataclasses import dataclass, replace
from functools import lru_cache
from math import pi

from pipeline.core.mesh import Mesh
from tests.support.variants import solids
from tests.support.variants.dimensions import HOLE_MOVES, Dimensions


@dataclass(frozen=True, slots=True)
class Plate:
    """On z = 0; nearly its own mirror image: in y but for the dowel holes, in z but for the counterbore."""

    length_mm: float
    width_mm: float
    thickness_mm: float
    corner_mm: float
    hole_radius_mm: float
    bore_radius_mm: float
    columns: int
    first_hole_shift_mm: float = 0.0
    has_first_hole: bool = True
    has_dowel_hole: bool = True

    @classmethod
    def sampled(cls, seed: int) -> "Plate":
        """Dimensions drawn for `seed`."""
        draw = Dimensions("plate", seed)
        return cls(
            length_mm=draw.mm(74, 100),
            width_mm=draw.mm(46, 62),
            thickness_mm=draw.mm(4, 8),
            corner_mm=draw.mm(5, 9),
            hole_radius_mm=draw.mm(2.2, 3.2),
            bore_radius_mm=draw.mm(7, 10),
            columns=3 + seed % 2,
        )

    @property
    def hole_volume_mm3(self) -> float:
        """Volume of the first hole, a cylinder."""
        return pi * self.hole_radius_mm**2 * self.thickness_mm

    def mesh(self) -> Mesh:
        """The part, closed."""
        return _built(self)

    def changes(self) -> "dict[str, Plate]":
        """The same part with one feature changed, by the name of the change."""
        size_mm = self.mesh().diagonal_mm
        moved = {
            name: replace(self, first_hole_shift_mm=share * size_mm) for name, share in HOLE_MOVES.items()
        }
        return {
            **moved,
            "hole filled": replace(self, has_first_hole=False),
            "dowel hole filled": replace(self, has_dowel_hole=False),
        }


@lru_cache(maxsize=64)
def _built(part: Plate) -> Mesh:
    length, width, t = part.length_mm, part.width_mm, part.thickness_mm
    outline = solids.rounded_rectangle((0.0, 0.0), (length, width), (part.corner_mm,) * 4)
    first, last = 0.1 * length, 0.9 * length
    pitch = (last - first) / (part.columns - 1)
    centres = [(first + pitch * k, share * width) for k in range(part.columns) for share in (0.15, 0.85)]
    if part.has_first_hole:
        centres[0] = (first + part.first_hole_shift_mm, 0.15 * width)
    else:
        centres = centres[1:]
    cuts = [solids.cylinder(centre, part.hole_radius_mm, -1.0, t + 1.0) for centre in centres]
    cuts.append(solids.cylinder((0.62 * length, 0.5 * width), part.bore_radius_mm, -1.0, t + 1.0))
    # the counterbore tells above from below: else the mirror image, turned over, is the plate itself
    counterbore = 1.3 * part.bore_radius_mm
    cuts.append(solids.cylinder((0.62 * length, 0.5 * width), counterbore, 0.62 * t, t + 1.0))
    cuts.append(
        solids.prism(
            solids.slot((0.2 * length, 0.5 * width), (0.36 * length, 0.5 * width), 3.1), -1.0, t + 1.0
        )
    )
    dowels = [(0.3 * length, 0.31 * width), (0.8 * length, 0.66 * width)]
    for centre in dowels if part.has_dowel_hole else dowels[1:]:
        cuts.append(solids.cylinder(centre, 1.9, -1.0, t + 1.0))
    return solids.carved([solids.prism(outline, 0.0, t)], cuts)
