"""Size of a registered scan over that of its design, along each axis and in all, with standard errors.

A diagnosis: a scale is never applied to the scan.
"""

from dataclasses import dataclass

import numpy as np

from pipeline.core.mesh import Mesh
from pipeline.kernels.similarity import ScaleEstimate, estimate_scale, residual_deformation_mm
from pipeline.kernels.surface import Surface
from pipeline.search.scan_model import ScanPoints
from pipeline.stages.registration import Registration

#: A factor of 2, beyond which the noise decides and not the surface. Chosen by hand.
MAX_SCALE_LOG2 = 1.0
#: Standard error of a factor above which it is not given: about what printed plastics shrink by. Chosen by
#: hand.
MAX_STANDARD_ERROR = 0.01
AXES = ("x", "y", "z")


@dataclass(frozen=True, slots=True)
class SizeFactor:
    """axis : of the design, `all` for one factor of all three; scale, standard_error : None where the scan
    does not determine it, and then `reason` says why
    """

    axis: str
    scale: float | None
    standard_error: float | None
    reason: str | None


@dataclass(frozen=True, slots=True)
class ScaleDiagnosis:
    """factors : of all axes together, then x, y, z; warp_mm : RMS residual deformation after scaling along
    the axes, None where that cannot be told
    """

    factors: tuple[SizeFactor, ...]
    warp_mm: float | None


def diagnose_scale(
    scan: Mesh, registration: Registration, design: Surface, sample_points: int, seed: int
) -> ScaleDiagnosis:
    """Scale and deformation of the registered scan relative to its design; `sample_points` of it are used.

    scan : in the frame of `registration.scan`, without stray pieces
    """
    points, best = ScanPoints.of(scan, sample_points, seed), registration.best
    normals = None if points.normals is None else best.normal_sign * points.normals
    isotropic, per_axis = (
        estimate_scale(
            *(points.points, points.weights, design, best.T_design_scan, registration.inlier_distance_mm),
            per_axis=each,
            normals=normals,
        )
        for each in (False, True)
    )
    factors = (*_factors(isotropic, ("all",)), *_factors(per_axis, AXES))
    finest = per_axis or isotropic
    warp_mm = None if finest is None else residual_deformation_mm(finest, points.weights)
    return ScaleDiagnosis(factors, warp_mm)


def _factors(estimate: ScaleEstimate | None, axes: tuple[str, ...]) -> tuple[SizeFactor, ...]:
    if estimate is None:
        return tuple(
            SizeFactor(axis, None, None, "too little of the scan lies on the design") for axis in axes
        )
    return tuple(
        _factor(axis, float(scale), float(error))
        for axis, scale, error in zip(axes, estimate.factors, estimate.standard_error, strict=True)
    )


def _factor(axis: str, scale: float, standard_error: float) -> SizeFactor:
    reason = None
    if np.isnan(scale):
        along = "" if axis == "all" else f" along {axis}"
        reason = f"the scan shows no surfaces whose distance would tell the size{along}"
    elif not scale > 0 or abs(float(np.log2(scale))) >= MAX_SCALE_LOG2:
        reason = "the noise of the scan decides it, not the surface"
    elif np.isnan(standard_error):
        reason = "too little of the surface is seen to say how well it is known"
    elif standard_error > MAX_STANDARD_ERROR:
        reason = f"it would be known to {100 * standard_error:.2g} % (1 sigma) only"
    if reason is not None:
        return SizeFactor(axis, None, None, reason)
    return SizeFactor(axis, scale, standard_error, None)
