"""Occlusion test of a pose: could a scanner have seen the scan's points past the design?

A scanner sees a point along an unobstructed line of sight. Where the file says where the scanner stood, these
lines are known (`LinesOfSight`): a pose is implausible if the design blocks them.

Most files do not say it, but each point was seen from the outer side of its surface (`ViewModel`). A pose is
implausible if the design blocks every direction from which a point may have been seen. A scan from a single
viewpoint gives a stricter test: all of its points were seen from about one direction.
"""

from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from pipeline.core.mesh import FloatArray
from pipeline.kernels import rigid
from pipeline.kernels.surface import Surface

#: Min share of the normals that make an angle below 90 degrees with their mean, for the scan to count as
#: taken from a single viewpoint (depth camera). Chosen by hand; not fitted.
ONE_VIEW = 0.97
#: Half angle in degrees of the cone around the mean normal that contains the camera. Chosen by hand; not
#: fitted.
CONE_DEG = 20.0
#: Angles in degrees between the normal and the directions tried, if the scanner moved around the part.
#: Chosen by hand; not fitted.
TILTS_DEG = (0.0, 30.0, 60.0)
#: Directions tried at each angle other than zero, evenly spaced around the normal. Chosen by hand; not
#: fitted.
AROUND = 6

#: Max share of the points that the design hides under a right pose, where the lines of sight are known; above
#: it under every pose, the file is wrong about its stations: scans that were merged, and say that they were
#: taken from one place. Such a cloud hides the half of itself. Chosen by hand: half of that.
MAX_HIDDEN_OF_RIGHT = 0.25
#: Sine of the smallest angle between a line of sight and the surface that is judged: on a flatter one, noise
#: decides whether the line starts within the material. Chosen by hand: 10 degrees.
MIN_GRAZING_SINE = 0.17


@dataclass(frozen=True, slots=True)
class LinesOfSight:
    """From points of a scan to the scanner that measured them.

    points : (k, 3) mm; scanner : (k, 3) mm, where it stood; both in the scan frame
    """

    points: FloatArray
    scanner: FloatArray

    def occlusion_ratio(self, T_design_scan: FloatArray, design: Surface, clearance_mm: float) -> float:
        """Share of the points, in [0, 1], that the design hides from the scanner that measured them.

        T_design_scan : (4, 4); design : in its own frame; clearance_mm : distance from the point at which its
        line of sight starts. A line that grazes the surface is never blocked
        """
        placed = rigid.transformed(T_design_scan, self.points)
        ends = rigid.transformed(T_design_scan, self.scanner)
        length_mm = np.linalg.norm(ends - placed, axis=1)
        towards = (ends - placed) / np.maximum(length_mm, 1e-300)[:, None]
        steep = np.abs(np.einsum("kd,kd->k", towards, design.closest(placed).normal)) > MIN_GRAZING_SINE
        tested = np.flatnonzero(steep & (length_mm > clearance_mm))
        starts = placed[tested] + clearance_mm * towards[tested]
        blocked = design.intersects_segments(starts, ends[tested])
        return float(blocked.sum()) / len(placed)


@dataclass(frozen=True, slots=True)
class ViewModel:
    """Directions from which the scanner may have seen each point.

    points : (k, 3) mm, scan frame; directions : (k, d, 3) unit vectors from the point towards the scanner
    """

    points: FloatArray
    directions: FloatArray

    @classmethod
    def of(cls, points: FloatArray, normals: FloatArray) -> "ViewModel":
        """The view model of a scan.

        points : (k, 3) mm, scan frame; normals : (k, 3) unit, outward. The normals decide whether the scan
        was taken from a single viewpoint.
        """
        mean = normals.sum(axis=0)
        mean = mean / max(float(np.linalg.norm(mean)), 1e-300)
        if float((normals @ mean > 0).mean()) >= ONE_VIEW:
            one = _cone(mean[None], (0.0, CONE_DEG))[0]
            return cls(points, np.broadcast_to(one, (len(points), *one.shape)))
        return cls(points, _cone(normals, TILTS_DEG))

    def occlusion_ratio(self, T_design_scan: FloatArray, design: Surface, clearance_mm: float) -> float:
        """Share of the points, in [0, 1], that the design occludes in every direction.

        T_design_scan : (4, 4); design : in its own frame; clearance_mm : distance from the point at which its
        lines of sight start, so that the design's own surface at the point does not occlude it
        """
        placed = rigid.transformed(T_design_scan, self.points)
        rotated = self.directions @ T_design_scan[:3, :3].T
        starts = placed[:, None] + clearance_mm * rotated
        occluded = design.intersects_rays(starts.reshape(-1, 3), rotated.reshape(-1, 3)).reshape(
            starts.shape[:2]
        )
        return float(occluded.all(axis=1).mean())


def _cone(axes: FloatArray, tilts_deg: tuple[float, ...]) -> FloatArray:
    """(k, d, 3) unit vectors around `axes` (k, 3, unit): `AROUND` at each angle of `tilts_deg`, one at angle
    0.
    """
    coordinate_axis = np.eye(3)[np.abs(axes).argmin(axis=1)]  # the coordinate axis farthest from it
    across = np.cross(axes, coordinate_axis)
    across /= np.maximum(np.linalg.norm(across, axis=1, keepdims=True), 1e-300)
    directions = []
    for tilt in tilts_deg:
        for number in range(AROUND if tilt else 1):
            sideways = Rotation.from_rotvec(2 * np.pi * number / AROUND * axes).apply(across)
            directions.append(np.cos(np.radians(tilt)) * axes + np.sin(np.radians(tilt)) * sideways)
    return np.stack(directions, axis=1)
