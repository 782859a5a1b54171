"""What could make the best pose the wrong answer: another unit, a mirror image, a second pose that is no symmetry.

Each is looked for only where the first fit gives cause, and only by evidence on the surfaces themselves.
"""

from dataclasses import dataclass, replace

import numpy as np

from pipeline.analysis import Analysis, Scales, analyse
from pipeline.kernels import icp, rigid, sampling
from pipeline.kernels.surface import Surface
from pipeline.mesh import FloatArray, Mesh
from pipeline.settings import RegistrationSettings, Settings
from pipeline.stages.matching import Matching, Side, match
from pipeline.stages.registration import Registration, fit, register, search
from pipeline.watch import silent

#: The scan's numbers times this are mm, when they were taken for mm; each with what a person calls the mix-up.
UNIT_FACTORS = {
    25.4: "inches read as mm",
    1 / 25.4: "mm read as inches",
    10.0: "cm read as mm",
    0.1: "mm read as cm",
    1000.0: "metres read as mm",
    0.001: "mm read as metres",
}
SIZES = (0.3, 1.4)  # a scan's diagonal over the design's, to be a part of it or the whole
LOOSE = 0.4  # of the residual limit: depth-camera scans lie at 0.5 to 0.8, printed copies below 0.2
SYMMETRY_RMS_SHARE = 0.0005  # of the diagonal: a design moved onto itself this near is symmetric under the motion,
SYMMETRY_MAX_SHARE = 0.003  # and nowhere farther off than this: a hole in another place is a small RMS
SAME_POSE_SHARE = 0.02
SYMMETRY_POINTS, SYMMETRY_ICP_POINTS = 10_000, 1_500


@dataclass(frozen=True, slots=True)
class Found:
    """One scan on its design: the scan (in mm, after `unit_factor`), its matching and registration; sides : as matched"""

    scan: Analysis
    sides: tuple[Side, Side]
    matching: Matching
    registration: Registration


@dataclass(frozen=True, slots=True)
class Doubts:
    """unit_factor : under which alone the scan fits; mirrored_rms_mm : truncated RMS of the reflected scan's best pose,
    None: not looked for; symmetric : for each rival whether it is a symmetry of the design
    """

    unit_factor: float | None
    mirrored_rms_mm: float | None
    symmetric: tuple[bool, ...]


def limit_mm(diagonal_mm: float, tolerance_mm: float | None, settings: RegistrationSettings) -> float:
    """How uncertain (one sigma) a motion may be: the tolerance, or a share of the diagonal."""
    return settings.free_motion_share * diagonal_mm if tolerance_mm is None else tolerance_mm


def fits(registration: Registration, diagonal_mm: float, settings: RegistrationSettings) -> bool:
    """Enough of the scan lies on the design, near enough."""
    enough = registration.fit.fitness >= settings.min_fitness and registration.design_coverage >= settings.min_coverage
    return enough and registration.fit.truncated_rms_mm <= settings.max_residual_share * diagonal_mm


def matched(
    design: Analysis, scan: Analysis, scales: Scales, settings: Settings, seed: int
) -> tuple[tuple[Side, Side], Matching]:
    length_mm = settings.matching.length_share * scales.size_mm
    sides = _described(design, length_mm, settings), _described(scan, length_mm, settings)
    return sides, match(*sides, length_mm, settings.matching, seed)


def registered(
    scan: Analysis,
    sides: tuple[Side, Side],
    matching: Matching,
    surface: Surface,
    settings: Settings,
    seed: int,
    certain_mm: float,
) -> Found:
    registration = register(scan.mesh, surface, matching, settings.registration, seed, certain_mm)
    return Found(scan, sides, matching, registration)


def examined(
    found: Found,
    design: Analysis,
    surface: Surface,
    scales: Scales,
    settings: Settings,
    seed: int,
    certain_mm: float,
) -> tuple[Found, Doubts]:
    """What stands after every doubt that the first fit gives cause for: another unit where it does not fit at all, the
    mirror image where it fits loosely, symmetries where there are rivals.
    """
    diagonal, asked = design.mesh.diagonal_mm, settings.registration
    unit_factor = mirrored = None
    if not fits(found.registration, diagonal, asked):
        other = in_another_unit(design, found.scan, surface, scales, settings, seed, certain_mm)
        if other is not None:
            unit_factor, found = other
    if unit_factor is None and found.registration.fit.truncated_rms_mm > asked.mirror_share * diagonal:
        mirrored = mirrored_rms_mm(found, surface, scales, settings, seed)
    rivals = found.registration.rivals
    examine = unit_factor is not None or fits(found.registration, diagonal, asked)
    symmetric = symmetries(found.registration, surface) if examine else (False,) * len(rivals)
    return found, Doubts(unit_factor, mirrored, symmetric)


def in_another_unit(
    design: Analysis,
    scan: Analysis,
    surface: Surface,
    scales: Scales,
    settings: Settings,
    seed: int,
    certain_mm: float,
) -> tuple[float, Found] | None:
    """The unit factor under which the scan fits the design, nearest in size first, or None."""
    diagonal = design.mesh.diagonal_mm
    ratio = scan.mesh.diagonal_mm / diagonal
    likely = [factor for factor in UNIT_FACTORS if SIZES[0] <= ratio * factor <= SIZES[1]]
    for factor in sorted(likely, key=lambda each: abs(np.log(ratio * each))):
        scaled = Mesh(scan.mesh.vertices * factor, scan.mesh.faces)
        again = analyse(scaled, "scan", scales, settings, silent(), seed)
        sides, matching = matched(design, again, scales, settings, seed)
        found = registered(again, sides, matching, surface, settings, seed, certain_mm)
        # A scan made small fits nearly anywhere: it must fit tightly, for its own size too.
        tight_mm = LOOSE * settings.registration.max_residual_share * min(diagonal, scaled.diagonal_mm)
        tight = found.registration.fit.truncated_rms_mm <= tight_mm and not found.registration.observability.free
        if tight and fits(found.registration, diagonal, settings.registration):
            return factor, found
    return None


def mirrored_rms_mm(found: Found, surface: Surface, scales: Scales, settings: Settings, seed: int) -> float:
    """Truncated RMS distance of the reflected scan under its best pose."""
    length_mm = settings.matching.length_share * scales.size_mm
    of_design, of_scan = found.sides
    matching = match(of_design, of_scan.reflected(length_mm, settings.matching), length_mm, settings.matching, seed)
    across = np.array([-1.0, 1.0, 1.0])
    scan = Mesh(found.scan.mesh.vertices * across, found.scan.mesh.faces[:, ::-1])
    best = search(scan, surface, matching, settings.registration, seed, thorough=False).best
    inlier = found.registration.inlier_distance_mm
    return fit(scan, surface, best.T_design_scan, inlier).truncated_rms_mm


def symmetries(registration: Registration, surface: Surface) -> tuple[bool, ...]:
    """For each rival whether the design is the same when moved from the best pose to it.

    The motion between two poses of a noisy scan is only nearly a symmetry, so it is refined on the design itself first.
    """
    design = surface.mesh
    samples = sampling.on_surface(design, SYMMETRY_POINTS, 0)
    back = rigid.inverse(registration.best.T_design_scan)
    return tuple(
        _is_symmetry(rival.T_design_scan @ back, samples.points, samples.normals, surface)
        for rival in registration.rivals
    )


def _is_symmetry(T: FloatArray, points: FloatArray, normals: FloatArray, surface: Surface) -> bool:
    diagonal = surface.mesh.diagonal_mm
    few = slice(None, None, len(points) // SYMMETRY_ICP_POINTS)
    weights = np.full(len(points[few]), 1.0 / len(points[few]))
    done = icp.refine(
        *(points[few], normals[few], weights, surface, T),
        max_distance_mm=0.02 * diagonal,
        max_iterations=30,
        tolerance_mm=1e-6 * diagonal,
    ).T_target_source
    if rigid.rms_displacement(done, T, points) > SAME_POSE_SHARE * diagonal:
        return False
    distance = surface.closest(rigid.transformed(done, points)).distance
    near = float(np.sqrt((distance**2).mean())) <= SYMMETRY_RMS_SHARE * diagonal
    return near and float(distance.max()) <= SYMMETRY_MAX_SHARE * diagonal


def _described(analysis: Analysis, length_mm: float, settings: Settings) -> Side:
    side = Side(analysis.resampled.mesh, analysis.landmarks)
    return replace(side, descriptors=side.described(length_mm, settings.matching))
