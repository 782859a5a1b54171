"""Point-to-point ICP of a moved copy of a point set back to the point set, from thousands of start poses.

Besl & McKay, "A method for registration of 3-D shapes" (1992): pair every point of the copy with its nearest
neighbour in the point set, apply the least-squares motion of the pairs (Horn 1987), and repeat. No pair is
rejected, whatever its distance. Two stopping rules (`RULES`) are evaluated on each trajectory. The C++ core
(`native/copy_icp.hpp`) gives the result of the plain algorithm in less time: it repeats the search of a point
only if the triangle inequality does not prove that the nearest neighbour is unchanged.

If all points are paired correctly, the motion is exact up to rounding. The sums over the points are plain
sums, as in common libraries, so the rounding error grows with the number of points.
"""

import os
from dataclasses import dataclass

import numpy as np

from pipeline.core.mesh import BoolArray, FloatArray, IntArray
from pipeline.kernels.geodesics import OnShare
from pipeline.kernels.native import core

#: The two stopping rules; the columns of every (t, 2) array below.
RULES = ("library", "converged")
#: Iterations of the rule "library", at most; the default of Open3D 0.20's registration_icp.
LIBRARY_ITERATIONS = 30
#: Change of the RMS distance, mm, at which the rule "library" stops; the default of Open3D 0.20's
#: registration_icp, whose "relative_rmse" is an absolute difference in the unit of the points.
LIBRARY_TOLERANCE = 1e-6
#: Iterations of the rule "converged", at most. Chosen by hand, not fitted: the largest number measured was
#: 122, on arches, printed parts and a plane with start poses up to 45 degrees away.
MAX_ITERATIONS = 1000
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
    """Result of t start poses, by each of RULES.

    T_points_copy : (t, 2, 4, 4) maps the copy to the points; iterations : (t, 2) number of estimated motions;
    converged : (t,) whether the pairs stopped changing within MAX_ITERATIONS
    """

    T_points_copy: FloatArray
    iterations: IntArray
    converged: BoolArray


class CopyIcp:
    """ICP of one point set: the search tree is built once and used for many start poses.

    points : (n, 3) mm, n >= 3, centred near the origin (rounding errors grow with the distance from it);
    threads : number of threads, by default all that this process may use; the results do not depend on it
    """

    def __init__(self, points: FloatArray, *, threads: int | None = None) -> None:
        self._core = core.CopyIcp(np.ascontiguousarray(points, dtype=np.float64))
        self._threads = threads or len(os.sched_getaffinity(0))

    def align(self, T_copy_points: FloatArray, on_share: OnShare | None = None) -> Alignments:
        """ICP of t copies `T_copy_points @ points`; T_copy_points : (t, 4, 4).

        on_share : called with the share done in [0, 1]

        Raises
        ------
        InterruptedError
            When `on_share` returns False.
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
        """(t,) mm: RMS over all points p of |T_points_copy @ T_copy_points @ p - p|, with true
        correspondences.

        T_copy_points, T_points_copy : (t, 4, 4)
        """
        return np.asarray(
            self._core.rms_error(_matrices(T_copy_points), _matrices(T_points_copy), self._threads)
        )


def _matrices(T: FloatArray) -> FloatArray:
    return np.ascontiguousarray(T, dtype=np.float64)
