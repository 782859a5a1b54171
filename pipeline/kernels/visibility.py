"""Could a scanner have seen these points, with the design where the pose puts it?

A scanner sees a point along a straight line that nothing crosses. The lines are not in the file, but each point was seen
from somewhere on the outer side of its surface: a pose that buries it behind the design on all sides is spoken against. A
scan of one view is stricter: all of it was seen from one direction.
"""

from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from pipeline.core.mesh import FloatArray
from pipeline.kernels import rigid
from pipeline.kernels.surface import Surface

ONE_VIEW = 0.97  # share of the normals on one side of their mean: a depth camera's picture
CONE_DEG = 20.0  # how well the mean normal tells where the camera was
TILTS_DEG = (0.0, 30.0, 60.0)  # around each normal where the scanner went round the part
AROUND = 6


@dataclass(frozen=True, slots=True)
class ViewModel:
    """points : (k, 3) of the scan; directions : (k, d, 3) unit, from where each may have been seen"""

    points: FloatArray
    directions: FloatArray

    @classmethod
    def of(cls, points: FloatArray, normals: FloatArray) -> "ViewModel":
        """normals : (k, 3), outward."""
        mean = normals.sum(axis=0)
        mean = mean / max(float(np.linalg.norm(mean)), 1e-300)
        if float((normals @ mean > 0).mean()) >= ONE_VIEW:
            one = _cone(mean[None], (0.0, CONE_DEG))[0]
            return cls(points, np.broadcast_to(one, (len(points), *one.shape)))
        return cls(points, _cone(normals, TILTS_DEG))

    def occlusion_ratio(self, T_design_scan: FloatArray, design: Surface, clearance_mm: float) -> float:
        """Share of the points that the design hides from every direction.

        clearance_mm : lines start so far from the point, so that it does not hide itself.
        """
        placed = rigid.transformed(T_design_scan, self.points)
        turned = self.directions @ T_design_scan[:3, :3].T
        starts = placed[:, None] + clearance_mm * turned
        blocked = design.blocks(starts.reshape(-1, 3), turned.reshape(-1, 3)).reshape(starts.shape[:2])
        return float(blocked.all(axis=1).mean())


def _cone(axes: FloatArray, tilts_deg: tuple[float, ...]) -> FloatArray:
    """(k, d, 3) directions tilted from each of `axes` (k, 3), `AROUND` of every tilt but zero."""
    first = np.eye(3)[np.abs(axes).argmin(axis=1)]  # the coordinate axis farthest from it
    across = np.cross(axes, first)
    across /= np.maximum(np.linalg.norm(across, axis=1, keepdims=True), 1e-300)
    found = []
    for tilt in tilts_deg:
        for number in range(AROUND if tilt else 1):
            turn = Rotation.from_rotvec(2 * np.pi * number / AROUND * axes).apply(across)
            found.append(np.cos(np.radians(tilt)) * axes + np.sin(np.radians(tilt)) * turn)
    return np.stack(found, axis=1)
