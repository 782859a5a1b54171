"""Matching and registering one scan to a design model: the stages of that name, with the model's parts put in
place.
"""

from dataclasses import dataclass

from pipeline.analysis.design_model import DesignModel
from pipeline.analysis.mesh_analysis import Analysis, describe_mesh
from pipeline.core.job_parameters import JobParameters
from pipeline.core.mesh import FloatArray
from pipeline.search.types import DescribedMesh, Matching
from pipeline.stages.matching import match, match_landmarks
from pipeline.stages.registration import Registration, register


@dataclass(frozen=True, slots=True)
class MatchedScan:
    """A scan with its hypotheses. scan : in mm; described : as matching uses it"""

    scan: Analysis
    described: DescribedMesh
    matching: Matching


@dataclass(frozen=True, slots=True)
class RegisteredScan:
    """A scan on its design. scan : in mm (after a unit factor, where one applies)"""

    scan: Analysis
    described: DescribedMesh
    registration: Registration


def match_scan(scan: Analysis, design: DesignModel, job: JobParameters) -> MatchedScan:
    """Hypotheses for the pose of an analysed scan."""
    described = describe_mesh(scan, design.scales, job.settings)
    return MatchedScan(scan, described, match_to_design(described, design, job))


def match_to_design(scan: DescribedMesh, design: DesignModel, job: JobParameters) -> Matching:
    """Hypotheses for the pose of a described scan."""
    symmetry, settings = design.symmetry, job.settings.matching
    return match(
        design.described,
        scan,
        design.matching_mm,
        settings,
        job.seed,
        symmetry.elements,
        symmetry.approximate,
    )


def register_scan(matched: MatchedScan, design: DesignModel, job: JobParameters) -> RegisteredScan:
    """The best pose and its quality."""

    def match_under(T_design_scan: FloatArray) -> Matching:
        return match_landmarks(
            design.described.landmarks,
            matched.described.landmarks,
            matched.matching.hypotheses,
            T_design_scan,
            design.matching_mm,
        )

    registration = register(
        matched.scan.mesh,
        design.surface,
        matched.matching,
        match_under,
        job.settings.registration,
        job.seed,
        job.max_sigma_mm(design.diagonal_mm),
        matched.scan.stations,
    )
    return RegisteredScan(matched.scan, matched.described, registration)
