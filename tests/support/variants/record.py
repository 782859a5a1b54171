"""What a variant of a design is, with its measured difference."""

from dataclasses import dataclass
from enum import StrEnum

import numpy as np

from pipeline.core.mesh import FloatArray, Mesh
from tests.support.variants.alignment import best_pose
from tests.support.variants.difference import SurfaceDifference, difference

#: Sorted extents of two parts that differ by less than this share of the diagonal: a check of the size cannot
#: tell the parts apart (calipers on a part printed with 0.5 % of shrinkage cannot).
SAME_OUTLINE_SHARE = 0.005


class Scope(StrEnum):
    """LOCAL : some features changed, the rest is the design and holds the true pose; GLOBAL : another shape
    or size everywhere; MIRRORED : the mirror image, local or global by what the symmetry leaves.
    """

    LOCAL = "local"
    GLOBAL = "global"
    MIRRORED = "mirrored"


@dataclass(frozen=True, slots=True, eq=False)
class Variant:
    """A part that is not the design.

    name : family, number and change; T_design_part : (4, 4), the identity where both share a frame,
    None where the part has no true pose; difference : in the true pose of a local change, else in the
    best one
    """

    name: str
    scope: Scope
    design: Mesh
    part: Mesh
    difference: SurfaceDifference
    T_design_part: FloatArray | None

    @property
    def difference_rms_mm(self) -> float:
        """RMS distance of the surfaces, both directions."""
        return self.difference.rms_mm

    @property
    def difference_max_mm(self) -> float:
        """Robust maximum of the distance within the changed region."""
        return self.difference.max_mm

    @property
    def changed_share(self) -> float:
        """Area that has changed, share of the area of the design, the larger of both directions."""
        return self.difference.share_above(self.difference.changed_mm)

    @property
    def is_same_outline(self) -> bool:
        """Whether the bounding boxes, in any order of the axes, have the same size within 0.5 %."""
        extents = [np.sort(np.ptp(mesh.vertices, axis=0)) for mesh in (self.design, self.part)]
        limit_mm = SAME_OUTLINE_SHARE * self.design.diagonal_mm
        return bool(np.abs(extents[0] - extents[1]).max() <= limit_mm)


def local_variant(name: str, design: Mesh, part: Mesh) -> Variant:
    """The part shares the frame of the design, and most of its surface."""
    return Variant(name, Scope.LOCAL, design, part, difference(design, part), np.eye(4))


def global_variant(name: str, design: Mesh, part: Mesh) -> Variant:
    """The part shares the frame of the design; its difference is measured in the best pose near that one."""
    _, left = best_pose(design, part, from_anywhere=False)
    return Variant(name, Scope.GLOBAL, design, part, left, np.eye(4))


def mirrored_variant(name: str, design: Mesh, part: Mesh) -> Variant:
    """The part is the mirror image at a plane through the middle of the design; no motion makes it the
    design, so `T_design_part` is the pose that leaves least.
    """
    pose, left = best_pose(design, part, from_anywhere=True)
    return Variant(name, Scope.MIRRORED, design, part, left, pose)


def other_shape_variant(name: str, design: Mesh, part: Mesh) -> Variant:
    """The part has no true pose."""
    _, left = best_pose(design, part, from_anywhere=True)
    return Variant(name, Scope.GLOBAL, design, part, left, None)
