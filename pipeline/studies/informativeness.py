"""The informativeness study of the paper: does ICP of landmarks alone restore a moved copy as well as ICP of
all points?

A trial has the paper's five steps:
(1) take a shape's vertices and their copy;
(2) move the copy by a translation, each coordinate uniform in [-noise, noise], and a rotation about a random
axis through its centre, the angle uniform in [0, rotation] (paper: 0); (3) run ICP of the complete shape from
there; (4) run ICP of the landmarks alone from there, and apply its motion to the complete shape; (5) compute
RMSE_c and RMSE_p over all vertices with true correspondences, and K = RMSE_c / RMSE_p.

Both ICPs are exact up to rounding once all points are paired correctly, so K often compares two rounding
errors. Such a trial is a *tie* and is counted separately. Plain sums over many points have larger rounding
errors than sums over few points, so K > 1 is nearly certain among ties, for any points: registration_icp of
Open3D gives K of about 8 for random points on an arch.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from pipeline.core.mesh import BoolArray, FloatArray, IndexArray, IntArray
from pipeline.core.settings import Detector
from pipeline.kernels import rigid
from pipeline.kernels.copy_icp import RULES, CopyIcp

#: Trials if the settings name none; the paper's number of random translations.
DEFAULT_TRIALS = 10_000
#: Noise over the diagonal if the settings name none: the paper's 2.5 mm on a dental arch.
DEFAULT_NOISE_SHARE = 0.03
#: Both errors below this share of the diagonal are a tie. Chosen by hand, not fitted, between rounding errors
#: (expected near 1e-14 of the diagonal, from the precision of float64) and the errors that a wrong pair
#: causes (expected at 1e-4 or more).
TIE = 1e-9
#: Trials in one call of the kernel; affects only the progress reports.
_CHUNK = 256


@dataclass(frozen=True, slots=True)
class Registered:
    """Result of ICP of one point set in t trials; the columns follow RULES.

    points : number of points; rmse_mm : (t, 2) over all vertices of the shape; iterations : (t, 2); converged
    : (t,) by the rule "converged"
    """

    points: int
    rmse_mm: FloatArray
    iterations: IntArray
    converged: BoolArray


@dataclass(frozen=True, slots=True)
class Informativeness:
    """All t trials. translation_mm : (t, 3); axis : (t, 3) unit; angle_deg : (t,); complete, landmarks :
    RMSE_c, RMSE_p.
    """

    noise_mm: float
    rotation_deg: float
    diagonal_mm: float
    translation_mm: FloatArray
    axis: FloatArray
    angle_deg: FloatArray
    complete: Registered
    landmarks: Mapping[Detector, Registered]

    def k(self, detector: Detector) -> FloatArray:
        """(t, 2) RMSE_c / RMSE_p. If RMSE_p is exactly 0: RMSE_c over the rounding of one coordinate, and 1
        for 0 / 0.
        """
        ours, theirs = self.landmarks[detector].rmse_mm, self.complete.rmse_mm
        unit = float(np.finfo(np.float64).eps) * self.diagonal_mm
        return np.where(ours > 0, theirs / np.where(ours > 0, ours, 1.0), (theirs + unit) / unit)

    def ties(self, detector: Detector) -> BoolArray:
        """(t, 2) whether both errors are rounding errors (below TIE)."""
        limit = TIE * self.diagonal_mm
        both = np.maximum(self.landmarks[detector].rmse_mm, self.complete.rmse_mm)
        return np.asarray(both < limit, dtype=np.bool_)


def informativeness(
    points: FloatArray,
    landmarks: Mapping[Detector, IndexArray | FloatArray],
    *,
    trials: int,
    noise_mm: float,
    rotation_deg: float,
    seed: int,
    threads: int | None = None,
    on_share: Callable[[float], None] = lambda _: None,
) -> Informativeness:
    """The study on one shape.

    points : (n, 3) mm, all vertices; landmarks : of each detector the vertices (k,) or positions (k, 3) mm, k
    >= 3; on_share : receives the finished share. The same arguments give the same bits for any number of
    threads, and the first trials of a long study equal those of a short one.

    Raises
    ------
    ValueError
        When a detector, or the shape, has fewer than three points.
    """
    centre = points.mean(axis=0)
    sets = [points, *(points[each] if each.ndim == 1 else each for each in landmarks.values())]
    for name, positions in zip(("the shape", *landmarks), sets, strict=True):
        if len(positions) < 3:
            raise ValueError(f"{name} has {len(positions)} points; a rigid motion needs 3")
    translation_mm, axis, angle_deg = _draw(trials, noise_mm, rotation_deg, seed)
    icps = [CopyIcp(positions - centre, threads=threads) for positions in sets]
    results = [
        Registered(
            len(positions),
            np.zeros((trials, len(RULES))),
            np.zeros((trials, len(RULES)), dtype=np.int32),
            np.zeros(trials, dtype=np.bool_),
        )
        for positions in sets
    ]
    progress = _Progress(on_share, trials * sum(len(positions) for positions in sets))
    for first in range(0, trials, _CHUNK):
        now = slice(first, min(trials, first + _CHUNK))
        rotation = np.radians(angle_deg[now, None]) * axis[now]
        T_copy_shape = rigid.from_vector(np.concatenate([rotation, translation_mm[now]], axis=1))
        for icp, result in zip(icps, results, strict=True):
            work = len(T_copy_shape) * result.points
            aligned = icp.align(T_copy_shape, progress.within(work))
            for rule in range(len(RULES)):
                result.rmse_mm[now, rule] = icps[0].rmse_mm(T_copy_shape, aligned.T_points_copy[:, rule])
            result.iterations[now] = aligned.iterations
            result.converged[now] = aligned.converged
            progress.add(work)
    return Informativeness(
        noise_mm,
        rotation_deg,
        float(np.linalg.norm(np.ptp(points, axis=0))),
        translation_mm,
        axis,
        angle_deg,
        results[0],
        dict(zip(landmarks, results[1:], strict=True)),
    )


class _Progress:
    """Accumulates finished work into a share of the total."""

    def __init__(self, on_share: Callable[[float], None], total: int) -> None:
        self._on_share, self._total, self._done = on_share, total, 0

    def add(self, work: int) -> None:
        self._done += work
        self._on_share(self._done / self._total)

    def within(self, work: int) -> Callable[[float], None]:
        """A listener for the share of the next `work`."""
        return lambda share: self._on_share((self._done + share * work) / self._total)


def _draw(
    trials: int, noise_mm: float, rotation_deg: float, seed: int
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """translation_mm (t, 3), axis (t, 3) uniform on the sphere, angle_deg (t,): six numbers of one stream a
    trial.
    """
    u = np.random.default_rng(seed).random((trials, 6))
    height, around = 2 * u[:, 4] - 1, 2 * np.pi * u[:, 5]
    ring = np.sqrt(1 - height**2)
    axis = np.stack([ring * np.cos(around), ring * np.sin(around), height], axis=1)
    return noise_mm * (2 * u[:, :3] - 1), axis, rotation_deg * u[:, 3]
