"""The best pose of a scan with its verdict; a view of one side is searched again before it is no match."""

from dataclasses import dataclass, replace

from pipeline.analysis.design_model import DesignModel
from pipeline.analysis.inputs import InputMesh
from pipeline.analysis.mesh_analysis import Analysis
from pipeline.analysis.part_of_scan import register_part
from pipeline.analysis.scan_registration import MatchedScan, RegisteredScan, match_scan
from pipeline.core.job_parameters import JobParameters
from pipeline.core.results import Verdict
from pipeline.core.settings import MatchingSettings
from pipeline.search.schedule import SECOND_SEARCH
from pipeline.verification.alternative_hypotheses import verify_hypotheses
from pipeline.verification.evidence import Case
from pipeline.verification.hypothesis_checks import HypothesisChecks
from pipeline.verification.scan_quality import ScannerQuality, assess_quality
from pipeline.verification.verdict import judge


@dataclass(frozen=True, slots=True, eq=False)
class JudgedPose:
    """input_scan : without what was left out as not the part; registered : the rest on the design"""

    input_scan: InputMesh
    registered: RegisteredScan
    quality: ScannerQuality
    checks: HypothesisChecks
    verdict: Verdict

    @property
    def rms_mm(self) -> float:
        """Of the scan's vertices to the design, truncated at the inlier distance."""
        return self.registered.registration.fit.truncated_rms_mm


def judged_pose(
    matched: MatchedScan, input_scan: InputMesh, design: DesignModel, job: JobParameters
) -> JudgedPose:
    """The best pose and the verdict on it.

    A scan of less than half of the design that matches nowhere is searched once more, with more hypotheses
    (`SECOND_SEARCH`): the few landmarks that one side shows may have had no right one among the first. The
    second pose counts where it leaves less.
    """
    first = _judged(matched, input_scan, design, job)
    matching = _more_hypotheses(job.settings.matching)
    if first.verdict.status != "no_match" or not _is_one_side(matched.scan, design):
        return first
    deeper = replace(job, settings=job.settings.model_copy(update={"matching": matching}))
    again = register_part(match_scan(matched.scan, design, deeper), input_scan, design, deeper)
    if again.registered.registration.fit.truncated_rms_mm >= first.rms_mm:
        return first
    return _verified(again.input_scan, again.registered, design, job)


def _judged(
    matched: MatchedScan, input_scan: InputMesh, design: DesignModel, job: JobParameters
) -> JudgedPose:
    part = register_part(matched, input_scan, design, job)
    return _verified(part.input_scan, part.registered, design, job)


def _verified(
    input_scan: InputMesh, registered: RegisteredScan, design: DesignModel, job: JobParameters
) -> JudgedPose:
    quality = assess_quality(input_scan.mesh, design.diagonal_mm, job)
    registered, checks = verify_hypotheses(registered, quality, design, job)
    verdict = judge(Case.of(registered, checks, quality, design, job), job.settings.registration)
    return JudgedPose(input_scan, registered, quality, checks, verdict)


def _is_one_side(scan: Analysis, design: DesignModel) -> bool:
    """Whether the scan, by its working mesh, shows less than `max_area_share` of the design's area."""
    shown_mm2 = float(scan.resampled.mesh.vertex_areas_mm2().sum())
    return shown_mm2 < SECOND_SEARCH.max_area_share * float(design.surface.mesh.face_areas_mm2().sum())


def _more_hypotheses(matching: MatchingSettings) -> MatchingSettings:
    more = {
        "candidates": SECOND_SEARCH.candidates,
        "max_pairs": SECOND_SEARCH.max_pairs,
        "max_hypotheses": SECOND_SEARCH.max_hypotheses,
    }
    return matching.model_copy(update={key: max(getattr(matching, key), of) for key, of in more.items()})
