"""Which other poses the design itself explains: where it repeats itself, as a rack of equal boxes does.

A second pose that fits nearly as well speaks against the part where it is another one, which fits nowhere.
It does not where what the scan shows of the design, moved on to the second pose, lies on the design again.
"""

import numpy as np

from pipeline.analysis.design_model import DesignModel
from pipeline.analysis.scan_registration import RegisteredScan
from pipeline.core.mesh import BoolArray, FloatArray
from pipeline.kernels import rigid
from pipeline.kernels.surface import Surface
from pipeline.search.scan_model import ScanPoints
from pipeline.search.schedule import REGISTRATION
from pipeline.verification.thresholds import HYPOTHESES


def repeats_of_design(registered: RegisteredScan, design: DesignModel, seed: int) -> BoolArray:
    """(k,) for each alternative pose whether the design repeats itself there: what it has under the scan, at
    the best pose, lies within `repeat_share` of the diagonal (RMS) of it after the motion from the best pose
    to the alternative. All False where less than `repeat_fitness` of the scan lies on the design.
    """
    registration = registered.registration
    found = np.zeros(len(registration.alternatives), dtype=np.bool_)
    if not len(found) or registration.fit.fitness < HYPOTHESES.repeat_fitness:
        return found
    T_best, reach_mm = registration.best.T_design_scan, registration.inlier_distance_mm
    samples = ScanPoints.of(registered.scan.mesh, REGISTRATION.coarse_samples, seed).points
    under = design.surface.closest(rigid.transformed(T_best, samples))
    shown = under.point[under.distance <= reach_mm]
    T_back = rigid.inverse(T_best)
    for number, pose in enumerate(registration.alternatives):
        off_mm = repetition_mm(design.surface, shown, pose.T_design_scan @ T_back, reach_mm)
        found[number] = off_mm <= HYPOTHESES.repeat_share * design.diagonal_mm
    return found


def repetition_mm(design: Surface, shown: FloatArray, motion: FloatArray, reach_mm: float) -> float:
    """RMS distance, mm, that the places `shown` (k, 3) of a surface lie off it after a `motion` (4, 4) of its
    frame; each counts `reach_mm` at most. Infinite without a place.
    """
    if not len(shown):
        return float("inf")
    distance_mm = np.minimum(design.closest(rigid.transformed(motion, shown)).distance, reach_mm)
    return float(np.sqrt((distance_mm**2).mean()))
