"""How far two surfaces lie apart in one frame, in both directions."""

from dataclasses import dataclass

import numpy as np

from pipeline.core.mesh import FloatArray, Mesh
from pipeline.kernels import sampling
from pipeline.kernels.surface import Surface

#: Samples of equal area on each surface: a patch of 0.1 % of the area has 20.
SAMPLES = 20_000
#: Distance above which a place has changed, share of the design's diagonal: as `INVISIBLE_CHANGE` of the
#: gauntlet. The meshes have no noise; chords of arcs are far below it.
CHANGED_SHARE_OF_DIAGONAL = 0.0005
#: Quantile of the distances within the changed region that stands for their maximum: single samples in a
#: corner do not count.
ROBUST_MAX = 0.99


@dataclass(frozen=True, slots=True, eq=False)
class SurfaceDifference:
    """Distances of equal-area samples of each surface to the other surface.

    of_design_mm, of_part_mm : (k,) sorted; design_area_mm2, part_area_mm2 : of the whole surfaces;
    changed_mm : distance above which a place has changed
    """

    of_design_mm: FloatArray
    of_part_mm: FloatArray
    design_area_mm2: float
    part_area_mm2: float
    changed_mm: float

    @property
    def rms_mm(self) -> float:
        """Root of the mean of both mean squares."""
        squares = [float(np.mean(side**2)) for side in (self.of_design_mm, self.of_part_mm)]
        return float(np.sqrt(sum(squares) / 2))

    @property
    def max_mm(self) -> float:
        """Quantile `ROBUST_MAX` of the distances within the changed region, the larger of both directions.

        0 where nothing has changed. Within the region: a small change counts as much as a large one.
        """
        changed = [side[side > self.changed_mm] for side in (self.of_design_mm, self.of_part_mm)]
        return max(float(np.quantile(side, ROBUST_MAX)) if side.size else 0.0 for side in changed)

    def area_above_mm2(self, limit_mm: float) -> float:
        """Area farther than `limit_mm` from the other surface, the larger of both directions."""
        return max(
            area * float(np.mean(side > limit_mm))
            for side, area in (
                (self.of_design_mm, self.design_area_mm2),
                (self.of_part_mm, self.part_area_mm2),
            )
        )

    def share_above(self, limit_mm: float) -> float:
        """`area_above_mm2` over the area of the design; at most 1."""
        return min(1.0, self.area_above_mm2(limit_mm) / self.design_area_mm2)


def difference(design: Mesh, part: Mesh) -> SurfaceDifference:
    """The difference as the two lie, symmetric but for the name of the sides and `changed_mm`."""
    sides = []
    for mesh, other in ((design, part), (part, design)):
        points = sampling.on_surface(mesh, SAMPLES, 0).points
        sides.append(np.sort(Surface(other).closest(points).distance))
    return SurfaceDifference(
        sides[0],
        sides[1],
        float(design.face_areas_mm2().sum()),
        float(part.face_areas_mm2().sum()),
        CHANGED_SHARE_OF_DIAGONAL * design.diagonal_mm,
    )
