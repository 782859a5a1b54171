"""How far a scan of a right part may lie off its design: by the scanner, the tolerance and the size of the
part.
"""

from dataclasses import dataclass

from pipeline.core.job_parameters import JobParameters
from pipeline.core.mesh import Mesh
from pipeline.kernels.local_noise import local_noise_mm

#: Noise that was measured on the scan explains at most this share of the diagonal: on few or large triangles
#: the shape itself looks like noise. Chosen by hand: above the noise of the cameras in the data.
MAX_MEASURED_SHARE = 0.003


@dataclass(frozen=True, slots=True)
class ScannerQuality:
    """noise_mm : scatter of the scan's points about their surface (1 sigma), None for too few points;
    accuracy_mm : of the scanner as stated (1 sigma), None where it is not; explained_mm : RMS distance that
    the scanner alone leaves; residual_limit_mm : truncated RMS distance up to which the pose may be `ok`
    """

    noise_mm: float | None
    accuracy_mm: float | None
    explained_mm: float
    residual_limit_mm: float


def assess_quality(scan: Mesh, design_diagonal_mm: float, job: JobParameters) -> ScannerQuality:
    """scan : cleaned, mm"""
    noise_mm = local_noise_mm(scan.vertices, job.seed, None if scan.is_cloud else scan.vertex_normals())
    stated_mm = job.settings.registration.scan_accuracy_mm
    measured_mm = min(noise_mm or 0.0, MAX_MEASURED_SHARE * design_diagonal_mm)
    return ScannerQuality(
        noise_mm,
        stated_mm,
        measured_mm if stated_mm is None else stated_mm,
        job.residual_limit_mm(design_diagonal_mm),
    )
