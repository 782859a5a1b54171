"""Under which motions a design is its own image, found by registering it to itself.

Every pose of a scan of such a design has equals: as right, and no reason to call the pose ambiguous.
"""

import numpy as np

from pipeline.kernels import icp, rigid, sampling
from pipeline.kernels.surface import Surface
from pipeline.mesh import FloatArray
from pipeline.settings import MatchingSettings
from pipeline.stages.matching import Side, match

RMS_SHARE = 0.0005  # of the diagonal: a design moved onto itself this near is symmetric under the motion,
MAX_SHARE = 0.003  # and nowhere farther off than this: a hole in another place is a small RMS
NEAR_SHARE = 0.003  # of the diagonal: a hypothesis that leaves more after its short ICP is none
SAME_POSE_SHARE = 0.02
LARGEST_GROUP = 24  # of n-fold parts; a body of revolution has no end
POINTS, ICP_POINTS = 10_000, 1_500


class SelfImages:
    """The motions (4, 4), design to design, under which it is its own image; `others` : without the identity"""

    def __init__(self, surface: Surface) -> None:
        self.others: tuple[FloatArray, ...] = ()
        self._surface = surface
        self._samples = sampling.on_surface(surface.mesh, POINTS, 0)
        self._diagonal = surface.mesh.diagonal_mm

    @classmethod
    def of(
        cls, surface: Surface, design: Side, length_mm: float, settings: MatchingSettings, seed: int
    ) -> "SelfImages":
        """Hypotheses from matching the design to itself, each refined and tested; products of two are motions of it too."""
        images = cls(surface)
        near = (NEAR_SHARE * images._diagonal) ** 2
        for hypothesis in match(design, design, length_mm, settings, seed).hypotheses:
            if hypothesis.cost_mm2 <= near:
                images._add(hypothesis.T_design_scan)
        number = 0
        while number < len(images.others) < LARGEST_GROUP:
            for first in images.others[: number + 1]:
                images._add(images.others[number] @ first)
                images._add(first @ images.others[number])
            number += 1
        return images

    def contains(self, T: FloatArray) -> bool:
        """Whether T (4, 4), as two poses of a noisy scan tell it, is one of them: known, or shown by the surface itself."""
        return any(self.same(T, each) for each in self.others) or self.refined(T) is not None

    def refined(self, T: FloatArray) -> FloatArray | None:
        """The motion near T (4, 4) under which the design is its own image, or None."""
        points, normals, diagonal = self._samples.points, self._samples.normals, self._diagonal
        few = slice(None, None, len(points) // ICP_POINTS)
        weights = np.full(len(points[few]), 1.0 / len(points[few]))
        done = icp.refine(
            *(points[few], normals[few], weights, self._surface, T),
            max_distance_mm=0.02 * diagonal,
            max_iterations=30,
            tolerance_mm=1e-6 * diagonal,
        ).T_target_source
        if not self.same(done, T):
            return None
        distance = self._surface.closest(rigid.transformed(done, points)).distance
        near = float(np.sqrt((distance**2).mean())) <= RMS_SHARE * diagonal
        return done if near and float(distance.max()) <= MAX_SHARE * diagonal else None

    def _add(self, T: FloatArray) -> None:
        if len(self.others) >= LARGEST_GROUP or any(self.same(T, each) for each in (np.eye(4), *self.others)):
            return
        refined = self.refined(T)
        if refined is not None:
            self.others += (refined,)

    def same(self, T: FloatArray, other: FloatArray) -> bool:
        """Whether the two motions put the design nearly in one place."""
        return rigid.rms_displacement(T, other, self._samples.points) <= SAME_POSE_SHARE * self._diagonal
