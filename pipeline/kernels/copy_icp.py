"""ICP of a moved copy of some points back to the points: thousands of starts, two stopping rules on each
trajectory.

Besl & McKay, "A method for registration of 3-D shapes" (1992): every point of the copy is paired with the
nearest of the points, the motion of least squares between the pairs (Horn 1987) is taken, and so on. No pair
is left out, however far apart. The C++ (`native/copy_icp.hpp`) gives what the plain algorithm gives, sooner:
a point is not asked for its nearest again while the triangle inequality proves that it is the same.

With all points paired right the motion is exact but for rounding. Sums over the points are plain, like any
library's, so that rounding error is larger the more points there are.
"""

import os
from dataclasses import dataclass

import numpy as np

from pipeline.core.mesh import BoolArray, FloatArray, IntArray
from pipeline.kernels.geodesics import OnShare
from pipeline.kernels.native import core

RULES = ("library", "converged")  # the columns of every (t, 2) below
LIBRARY_ITERATIONS = 30  # the defaults of open3d.pipelines.registration.registration_icp (0.20)
LIBRARY_TOLERANCE = 1e-6  # its "relative_rmse" is a difference, in the unit of the points
MAX_ITERATIONS = (
    1000  # of the other rule; 122 was the most on arches, printed parts and a plane, up to 45 degrees away
)
DESCRIPTIONS = {
    "library": f"the defaults of Open3D's registration_icp: until the RMS distance of the pairs "
    "changes by less than "
    f"{LIBRARY_TOLERANCE:g} mm, at most {LIBRARY_ITERATIONS} iterations; no limit to the distance of a pair",
    "converged": "until no pair changes, so that every further motion is the same, at most "
    f"{MAX_ITERATIONS} iterations; "
    "no limit to the distance of a pair",
}


@dataclass(frozen=True, slots=True)
class Alignments:
    """Where t starts ended, by each of RULES.

    T_points_copy : (t, 2, 4, 4) takes the copy to the points; iterations : (t, 2) motions estimated until
    then; converged : (t,) whether the pairs stayed the same within MAX_ITERATIONS
    """

    T_points_copy: FloatArray
    iterations: IntArray
    converged: BoolArray


class CopyIcp:
    """One set of points: built once, aligned often.

    points : (n, 3) mm, n >= 3, their middle near the origin (rounding errors grow with the distance from it);
    threads : default all this process may use; no result depends on their number
    """

    def __init__(self, points: FloatArray, *, threads: int | None = None) -> None:
        self._core = core.CopyIcp(np.ascontiguousarray(points, dtype=np.float64))
        self._threads = threads or len(os.sched_getaffinity(0))

    def align(self, T_copy_points: FloatArray, on_share: OnShare | None = None) -> Alignments:
        """ICP from where each motion in T_copy_points (t, 4, 4) puts the copy: `copy = T_copy_points @
        points`.
        """
        library, converged, library_iterations, iterations, is_converged = self._core.align(
            *(_matrices(T_copy_points), LIBRARY_ITERATIONS, LIBRARY_TOLERANCE, MAX_ITERATIONS),
            *(self._threads, on_share),
        )
        return Alignments(
            np.stack([library, converged], axis=1),
            np.stack([library_iterations, iterations], axis=1),
            np.asarray(is_converged, dtype=np.bool_),
        )

    def rmse_mm(self, T_copy_points: FloatArray, T_points_copy: FloatArray) -> FloatArray:
        """(t,) RMS over all points of |T_points_copy @ (T_copy_points @ p) - p|: each point to its own, both
        (t, 4, 4).
        """
        return np.asarray(
            self._core.rms_error(_matrices(T_copy_points), _matrices(T_points_copy), self._threads)
        )


def _matrices(T: FloatArray) -> FloatArray:
    return np.ascontiguousarray(T, dtype=np.float64)
