"""What could make the best pose the wrong answer: another unit, a mirror image, a second pose that is no symmetry.

Each is looked for only where the first fit gives cause, and only by evidence on the surfaces themselves.
"""

from dataclasses import dataclass, replace

import numpy as np

from pipeline.analysis.design_model import Design, described
from pipeline.analysis.mesh_analysis import Analysis, analyse
from pipeline.analysis.symmetry_group import RMS_SHARE
from pipeline.core.errors import PipelineError
from pipeline.core.mesh import FloatArray, Mesh
from pipeline.core.settings import RegistrationSettings, Settings
from pipeline.core.timing import silent
from pipeline.kernels import rigid
from pipeline.search.pose_search import TRIAL_POINTS, Pose, Scan, ScanPoints, search
from pipeline.search.score_ratio import LOOSE, LOOSE_MARGIN
from pipeline.stages.matching import Matching, Side, match, with_matches
from pipeline.stages.registration import Registration, fit, register

#: The scan's numbers times this are mm, when they were taken for mm; each with what a person calls the mix-up.
UNIT_FACTORS = {
    25.4: "inches read as mm",
    1 / 25.4: "mm read as inches",
    10.0: "cm read as mm",
    0.1: "mm read as cm",
    1000.0: "metres read as mm",
    0.001: "mm read as metres",
}
MARK_TELLS = 0.95  # times the cost of the best pose: an image of it that costs less,
MARK_SHARE = 0.0001  # of the diagonal, squared: and by more than this, is the better pose
WHOLE = 0.9  # times the design's diagonal: a bolt in inches is a bolt, though it can turn
SIZES = (0.3, 1.4)  # a scan's diagonal over the design's, to be a part of it or the whole


@dataclass(frozen=True, slots=True)
class Asked:
    """What a job says beside its meshes."""

    settings: Settings
    seed: int
    tolerance_mm: float | None

    def certain_mm(self, design: Design) -> float:
        """How uncertain (one sigma) a motion may be: the tolerance, or a share of the diagonal."""
        share = self.settings.registration.free_motion_share
        return share * design.diagonal_mm if self.tolerance_mm is None else self.tolerance_mm


@dataclass(frozen=True, slots=True)
class Found:
    """One scan on its design: the scan (in mm, after `unit_factor`), as matching sees it, and its registration"""

    scan: Analysis
    side: Side
    registration: Registration


@dataclass(frozen=True, slots=True)
class Doubts:
    """unit_factor : under which alone the scan fits; mirrored_rms_mm : truncated RMS of the reflected scan's best pose,
    None: not looked for; symmetric : for each rival whether it is a symmetry of the design
    """

    unit_factor: float | None
    mirrored_rms_mm: float | None
    symmetric: tuple[bool, ...]


def fits(registration: Registration, diagonal_mm: float, settings: RegistrationSettings) -> bool:
    """Enough of the scan lies on the design, near enough."""
    enough = (
        registration.fit.fitness >= settings.min_fitness
        and registration.design_coverage >= settings.min_coverage
    )
    return enough and registration.fit.truncated_rms_mm <= settings.max_residual_share * diagonal_mm


def matched(scan: Analysis, design: Design, asked: Asked) -> tuple[Side, Matching]:
    side = described(scan, design.scales, asked.settings)
    return side, _match(design, side, asked)


def registered(scan: Analysis, side: Side, matching: Matching, design: Design, asked: Asked) -> Found:
    length_mm = design.scales.matching_mm(asked.settings)

    def matched_under(T_design_scan: FloatArray) -> Matching:
        return with_matches(design.side, side, matching.hypotheses, T_design_scan, length_mm)

    settings, certain_mm = asked.settings.registration, asked.certain_mm(design)
    registration = register(
        scan.mesh, design.surface, matching, matched_under, settings, asked.seed, certain_mm
    )
    return Found(scan, side, registration)


def examined(found: Found, design: Design, asked: Asked) -> tuple[Found, Doubts]:
    """What stands after every doubt that the first fit gives cause for: another unit where it does not fit at all, the
    mirror image where it fits loosely; and which rivals are as right as the best.
    """
    diagonal, settings = design.diagonal_mm, asked.settings.registration
    unit_factor = mirrored = None
    if not fits(found.registration, diagonal, settings):
        other = in_another_unit(found.scan, design, asked)
        if other is not None:
            unit_factor, found = other
    if unit_factor is None and found.registration.fit.truncated_rms_mm > settings.mirror_share * diagonal:
        mirrored = mirrored_rms_mm(found, design, asked)
    if unit_factor is None and not fits(found.registration, diagonal, settings):
        return found, Doubts(unit_factor, mirrored, (False,) * len(found.registration.rivals))
    found, symmetric = _with_self_images(found, design, asked)
    return found, Doubts(unit_factor, mirrored, symmetric)


def in_another_unit(scan: Analysis, design: Design, asked: Asked) -> tuple[float, Found] | None:
    """The unit factor under which the scan fits the design, nearest in size first, or None."""
    diagonal, settings = design.diagonal_mm, asked.settings.registration
    ratio = scan.mesh.diagonal_mm / diagonal
    likely = [factor for factor in UNIT_FACTORS if SIZES[0] <= ratio * factor <= SIZES[1]]
    for factor in sorted(likely, key=lambda each: abs(np.log(ratio * each))):
        scaled = Mesh(scan.mesh.vertices * factor, scan.mesh.faces)
        try:
            again = analyse(scaled, "scan", design.scales, asked.settings, silent(), asked.seed)
        except PipelineError:  # a scan that nobody sent: that it cannot be analysed is no fault of the job
            continue
        found = registered(again, *matched(again, design, asked), design, asked)
        # A scan made small fits nearly anywhere: it must fit tightly, for its own size too, and be held.
        tight_mm = LOOSE * settings.max_residual_share * min(diagonal, scaled.diagonal_mm)
        tight = found.registration.fit.truncated_rms_mm <= tight_mm
        held = scaled.diagonal_mm >= WHOLE * diagonal or not found.registration.observability.unconstrained
        if tight and held and fits(found.registration, diagonal, settings):
            return factor, found
    return None


def mirrored_rms_mm(found: Found, design: Design, asked: Asked) -> float:
    """Truncated RMS distance of the reflected scan under its best pose."""
    settings = asked.settings
    length_mm = design.scales.matching_mm(settings)
    matching = _match(design, found.side.reflected(length_mm, settings.matching), asked)
    across = np.array([-1.0, 1.0, 1.0])
    mesh = Mesh(found.scan.mesh.vertices * across, found.scan.mesh.faces[:, ::-1])
    scan = Scan(mesh, settings.registration, asked.seed)
    best = search(scan, design.surface, matching, settings.registration, thorough=False).best
    inlier = found.registration.inlier_distance_mm
    return fit(mesh, mesh.weights(), design.surface, best.T_design_scan, inlier).truncated_rms_mm


def _with_self_images(found: Found, design: Design, asked: Asked) -> tuple[Found, tuple[bool, ...]]:
    """The rivals, those added that the design's own symmetries make of the best pose; for each whether it is one.

    A design that is its own image but for a small mark is tried in each of its poses: the mark tells.
    """
    images, diagonal = design.images, design.diagonal_mm
    if not (images.others or images.near):
        return found, _symmetric(found, design)
    best, inlier = found.registration.best, found.registration.inlier_distance_mm
    settings = asked.settings.registration
    few = ScanPoints.of(found.scan.mesh, TRIAL_POINTS, asked.seed)
    elsewhere = [image @ best.T_design_scan for image in (*images.others, *images.near)]
    closest = min(elsewhere, key=lambda T: few.left(T, design.surface, inlier).cost_mm2)
    every = ScanPoints.of(found.scan.mesh, settings.sample_points, asked.seed)

    def placed(T: FloatArray) -> Pose:
        left = every.left(T, design.surface, inlier)
        return replace(
            best, T_design_scan=T, cost_mm2=left.cost_mm2, rmse_mm=left.rmse_mm, score_mm2=left.cost_mm2
        )

    if placed(closest).cost_mm2 < MARK_TELLS * best.cost_mm2 - (MARK_SHARE * diagonal) ** 2:
        found = _begun_at(closest, found, design, asked)
        best = found.registration.best
    symmetric, rivals = _symmetric(found, design), found.registration.rivals
    back = rigid.inverse(best.T_design_scan)
    relative = [rival.T_design_scan @ back for rival in rivals]
    missing = [image for image in images.others if not any(images.same(image, T) for T in relative)]
    added = tuple(
        pose for image in missing if _is_as_right(pose := placed(image @ best.T_design_scan), best, design)
    )
    registration = replace(found.registration, rivals=(*rivals, *added))
    return replace(found, registration=registration), (*symmetric, *(True for _ in added))


def _symmetric(found: Found, design: Design) -> tuple[bool, ...]:
    best = found.registration.best
    back = rigid.inverse(best.T_design_scan)
    return tuple(
        _is_as_right(rival, best, design) and design.images.contains(rival.T_design_scan @ back)
        for rival in found.registration.rivals
    )


def _is_as_right(pose: Pose, best: Pose, design: Design) -> bool:
    """Not so where the scan itself tells an image of the pose from it, by a mark that the symmetry passes over."""
    return pose.cost_mm2 <= LOOSE_MARGIN * best.cost_mm2 + (RMS_SHARE * design.diagonal_mm) ** 2


def _begun_at(T_design_scan: FloatArray, found: Found, design: Design, asked: Asked) -> Found:
    """Registered anew from a pose that lies better than the best so far."""
    matching, best = found.registration.matching, found.registration.best
    first = replace(matching.hypotheses[0], T_design_scan=T_design_scan, facing=best.facing)
    length_mm = design.scales.matching_mm(asked.settings)
    again = with_matches(design.side, found.side, (first, *matching.hypotheses), T_design_scan, length_mm)
    return registered(found.scan, found.side, again, design, asked)


def _match(design: Design, scan: Side, asked: Asked) -> Matching:
    length_mm = design.scales.matching_mm(asked.settings)
    return match(
        design.side,
        scan,
        length_mm,
        asked.settings.matching,
        asked.seed,
        design.images.others,
        design.images.near,
    )
