"""Which pieces of a scan are the part: a table, a clamp or another part in the scan is left out.

What is too large for the design is left out before the search. What lies nowhere on the design under the best
pose is left out after it, and the rest is registered anew.
"""

from dataclasses import dataclass

import numpy as np

from pipeline.analysis.design_model import DesignModel
from pipeline.analysis.inputs import InputMesh
from pipeline.analysis.mesh_analysis import analyse_mesh
from pipeline.analysis.scan_registration import MatchedScan, RegisteredScan, match_scan, register_scan
from pipeline.core.errors import PipelineError
from pipeline.core.job_parameters import JobParameters
from pipeline.core.timing import silent
from pipeline.stages.strays import MIN_REST_COVERAGE, only_piece, piece_candidates, without_off_design

#: Share of the scan within the inlier distance from which on no piece is looked for that lies off the design.
#: Chosen by hand.
WHOLE_FITNESS = 0.999
#: A scan of which less lies on the design is searched piece by piece too. Chosen by hand.
POOR_FITNESS = 0.8


@dataclass(frozen=True, slots=True)
class PartOfScan:
    """input_scan : without what was left out; registered : the rest on the design"""

    input_scan: InputMesh
    registered: RegisteredScan


def register_part(
    matched: MatchedScan, input_scan: InputMesh, design: DesignModel, job: JobParameters
) -> PartOfScan:
    """The scan on its design; where pieces of it lie off the design, the rest of it.

    Of a scan that fits poorly each piece of the size of a part is tried alone; it is taken where it alone
    fits, and shows enough of the design to be judged by: a small piece fits on many a part.
    """
    whole = PartOfScan(input_scan, register_scan(matched, design, job))
    if _fitness(whole) >= WHOLE_FITNESS:
        return whole
    trimmed = _without_off_design(whole, design, job)
    if _fitness(trimmed) >= POOR_FITNESS:
        return trimmed
    best = trimmed
    for piece in piece_candidates(input_scan.cleaned, design.analysis.mesh):
        alone = _registered(input_scan.without(*only_piece(input_scan.cleaned, piece)), design, job)
        if alone is None or alone.registered.registration.design_coverage < MIN_REST_COVERAGE:
            continue
        if _fitness(alone) > max(POOR_FITNESS, _fitness(best)):
            best = alone
    return best


def _without_off_design(whole: PartOfScan, design: DesignModel, job: JobParameters) -> PartOfScan:
    registration = whole.registered.registration
    rest = without_off_design(
        whole.input_scan.cleaned,
        registration.fit.closest.distance,
        registration.inlier_distance_mm,
        design.surface,
    )
    if not rest[1].any:
        return whole
    again = _registered(whole.input_scan.without(*rest), design, job)
    return whole if again is None or _fitness(again) < _fitness(whole) else again


def _registered(input_scan: InputMesh, design: DesignModel, job: JobParameters) -> PartOfScan | None:
    """None where too little is left to be analysed."""
    try:
        scan = analyse_mesh(
            *(input_scan.mesh, "scan", design.scales, job.settings, silent(), job.seed),
            stations=input_scan.stations,
        )
        return PartOfScan(input_scan, register_scan(match_scan(scan, design, job), design, job))
    except PipelineError:
        return None


def _fitness(part: PartOfScan) -> float:
    return float(np.clip(part.registered.registration.fit.fitness, 0.0, 1.0))
