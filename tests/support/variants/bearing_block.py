"""A pillow block: foot with two holes, round housing with a bore, gussets, and a grease boss on one side."""

from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np

from pipeline.core.mesh import Mesh
from tests.support.variants import solids
from tests.support.variants.dimensions import HOLE_MOVES, Dimensions


@dataclass(frozen=True, slots=True)
class BearingBlock:
    """Foot on z = 0, bore along y; nearly its own mirror image in x but for the boss and the id pad."""

    length_mm: float
    depth_mm: float
    foot_mm: float
    axis_height_mm: float
    bore_share: float
    foot_hole_shift_mm: float = 0.0
    has_foot_hole: bool = True
    has_rib: bool = True
    has_boss: bool = True

    @classmethod
    def sampled(cls, seed: int) -> "BearingBlock":
        """Dimensions drawn for `seed`."""
        draw = Dimensions("bearing block", seed)
        length = draw.mm(76, 100)
        return cls(
            length_mm=length,
            depth_mm=draw.mm(26, 36),
            foot_mm=draw.mm(9, 13),
            axis_height_mm=round(length * draw.share(0.34, 0.42), 1),
            bore_share=draw.share(0.55, 0.68),
        )

    def mesh(self) -> Mesh:
        """The part, closed."""
        return _built(self)

    def changes(self) -> "dict[str, BearingBlock]":
        """The same part with one feature changed, by the name of the change."""
        size_mm = self.mesh().diagonal_mm
        moved = {
            name: replace(self, foot_hole_shift_mm=share * size_mm) for name, share in HOLE_MOVES.items()
        }
        return {
            **moved,
            "hole filled": replace(self, has_foot_hole=False),
            "rib missing": replace(self, has_rib=False),
            "boss missing": replace(self, has_boss=False),
        }


@lru_cache(maxsize=64)
def _built(part: BearingBlock) -> Mesh:
    length, depth, foot, axis = part.length_mm, part.depth_mm, part.foot_mm, part.axis_height_mm
    middle, radius = length / 2, 0.2 * length
    rounding = 0.06 * length
    outline = solids.rounded_rectangle((0.0, 0.0), (length, depth), (rounding,) * 4)
    low, high = 0.06 * depth, 0.94 * depth
    ring = solids.circle((middle, axis), radius)
    left, right = middle - radius, middle + radius
    housing = np.array([[left, 0.5 * foot], [right, 0.5 * foot], [right, axis], [left, axis]])
    solid = [
        solids.prism(outline, 0.0, foot),
        solids.prism_along_y(ring, low, high),
        solids.prism_along_y(housing, low, high),
        solids.cylinder((0.83 * length, 0.3 * depth), 0.05 * length, 0.6 * foot, foot + 1.2),
    ]
    for side in (-1, 1) if part.has_rib else (1,):
        near, far, top = middle + side * 0.9 * radius, middle + side * 0.34 * length, 0.85 * axis
        gusset = np.array([[near, 0.6 * foot], [far, 0.6 * foot], [far, foot + 1.0], [near, top]])
        solid.append(
            solids.prism_along_y(gusset if side > 0 else gusset[::-1], 0.42 * depth, 0.42 * depth + 5.0)
        )
    boss = (middle + 0.05 * length, 0.34 * depth)
    if part.has_boss:
        solid.append(solids.cylinder(boss, 0.045 * length, axis, axis + 1.22 * radius))
    cuts = [
        solids.prism_along_y(solids.circle((middle, axis), part.bore_share * radius), -1.0, depth + 1.0),
        solids.cylinder(boss, 1.4, axis, axis + 2.0 * radius),
        solids.cylinder((0.9 * length, 0.5 * depth), 0.042 * length, -1.0, foot + 1.0),
    ]
    if part.has_foot_hole:
        hole = (0.1 * length, 0.5 * depth + part.foot_hole_shift_mm)
        cuts.append(solids.cylinder(hole, 0.042 * length, -1.0, foot + 1.0))
    return solids.carved(solid, cuts)
