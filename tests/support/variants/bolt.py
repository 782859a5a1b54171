"""Hexagon head bolts with the proportions of ISO 4014, without a helical thread."""

from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np

from pipeline.core.mesh import Mesh
from tests.support.variants import solids
from tests.support.variants.dimensions import Dimensions

#: Nominal diameter -> width across flats s, head height k, minor diameter d3, thread length b, mm. From
#: ISO 4014 (s, k, b for lengths up to 125 mm) and ISO 724 (d3 as drawn for the thread section).
SIZES_MM = {
    6: (10.0, 4.0, 4.77, 18.0),
    8: (13.0, 5.3, 6.47, 22.0),
    10: (16.0, 6.4, 8.16, 26.0),
    12: (18.0, 7.5, 9.85, 30.0),
}
#: Chamfer of the head: 30 degrees, as ISO 4014 allows (15 to 30 degrees).
CHAMFER_SLOPE = 3**-0.5


@dataclass(frozen=True, slots=True)
class Bolt:
    """Head above z = 0 (its bearing face), shank below; six-fold about z, and mirror-symmetric, as meant."""

    size: int
    length_mm: float

    @classmethod
    def sampled(cls, seed: int) -> "Bolt":
        """M6, M8, M10 in turn, of a drawn length."""
        return cls(size=(6, 8, 10)[seed % 3], length_mm=round(Dimensions("bolt", seed).mm(45, 70)))

    def next_size(self) -> "Bolt":
        """The next larger bolt of the same length."""
        return replace(self, size=self.size + 2)

    def mesh(self) -> Mesh:
        """The part, closed."""
        return _built(self)

    def changes(self) -> "dict[str, Bolt]":
        """No local ones."""
        return {}


@lru_cache(maxsize=16)
def _built(part: Bolt) -> Mesh:
    flats, head, minor, thread = SIZES_MM[part.size]
    radius, end = part.size / 2, -part.length_mm
    shank = np.array(
        [
            [0.8 * minor / 2, end],
            [minor / 2, end + 0.1 * part.size],
            [minor / 2, end + thread],
            [radius, end + thread + 0.5 * (part.size - minor)],
            [radius, -0.05 * part.size],
            [1.1 * radius, 0.0],
            [1.1 * radius, 0.5 * head],
        ]
    )
    inner, outer = 0.475 * flats, 0.7 * flats
    drop = (outer - inner) * CHAMFER_SLOPE
    chamfer = np.array([[inner, head], [outer, head - drop], [outer, head + 1.0], [inner, head + 1.0]])
    solid = [solids.prism(solids.hexagon(flats), 0.0, head), solids.stacked(shank)]
    return solids.carved(solid, [solids.revolved(chamfer)])
