"""Is the scan longer along one direction than its design, or larger, than a print and its scan explain?

The residual alone does not tell: what is smooth counts as distortion of the print. But a distortion leaves
more than a uniform strain takes away, and another size of the part leaves nothing.
"""

from pipeline.core.mesh import Mesh
from pipeline.kernels.strain import Strain, estimate_strain
from pipeline.kernels.surface import Surface
from pipeline.search.scan_model import ScanPoints
from pipeline.stages.registration import Fit
from pipeline.verification.thresholds import SIZE


def assess_size(scan: Mesh, fit: Fit, design: Surface, inlier_mm: float, seed: int) -> Strain | None:
    """The strain of the scan under one pose, in the frame of the design; None where it is not determined."""
    samples = ScanPoints.of(scan, SIZE.samples, seed)
    strain = estimate_strain(samples.points, samples.weights, design, fit.T_design_scan, inlier_mm)
    if strain is None or max(abs(strain.principal)) > SIZE.max_strain:
        return None
    explained_mm = max(strain.shape_mm, strain.size_mm)
    residual_mm = SIZE.max_over_residual * fit.truncated_rms_mm
    return strain if explained_mm <= max(residual_mm, strain.left_mm) else None


def is_stretched(strain: Strain, accuracy_mm: float) -> bool:
    """Whether it is longer along one direction than along another. accuracy_mm : of the scanner as stated (1
    sigma), or 0
    """
    shown_mm = max(SIZE.min_over_left * strain.left_mm, accuracy_mm)
    return strain.spread >= SIZE.min_stretch and strain.shape_mm >= shown_mm


def is_other_size(strain: Strain, accuracy_mm: float) -> bool:
    """Whether it is larger or smaller as a whole. accuracy_mm : see `is_stretched`"""
    shown_mm = max(SIZE.min_over_left * strain.left_mm, accuracy_mm)
    return abs(strain.mean) >= SIZE.min_size and strain.size_mm >= shown_mm
