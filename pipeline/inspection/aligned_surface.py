"""Alignments to the surface: best fit of chosen regions, with motions held, and the fit to the limits."""

import numpy as np

from pipeline.core.acceptance import Acceptance, Limits, Region
from pipeline.core.alignment import BestFit, ConstrainedFit, ToleranceFit
from pipeline.core.mesh import BoolArray, FloatArray
from pipeline.core.sentences import sentence
from pipeline.inspection import regions
from pipeline.inspection.alignment_types import AlignmentFailed, Found, Placed
from pipeline.inspection.pose_error import of_surface_fit, patch_edge_mm
from pipeline.kernels import rigid
from pipeline.kernels.constrained_fit import AllowedMotions, step
from pipeline.kernels.icp import STALL_ITERATIONS, STALL_SHARE

#: Vertices that a fit uses, at most: every k-th of more. As the fine samples of the registration by order.
MAX_VERTICES = 50_000
#: Vertices that a fit needs, at least: six unknowns need six (derived).
MIN_VERTICES = 6
#: A step that moves the vertices by less (RMS), over the inlier distance, is the last. Chosen by hand.
LAST_STEP_SHARE = 1e-5
MAX_STEPS = 100
#: Of a fit to limits: how much the surface between its limits counts, so that it lies in their middle where
#: there is room; and the share of the distance between the limits that is kept free at each. By hand.
WITHIN_WEIGHT, MARGIN_SHARE = 1e-6, 0.02
#: Halvings of a step of the fit to limits, and steps on one set of closest points. Chosen by hand.
HALVINGS, INNER_STEPS = 20, 50
_HELD = ("rx", "ry", "rz", "tx", "ty", "tz")


def fit_surface(placed: Placed, alignment: BestFit | ConstrainedFit) -> Found:
    """Best fit on the regions of `alignment`, or on all; a best fit of all is the automatic pose."""
    T, weights = placed.start.T_design_scan, _weights(placed, alignment)
    if isinstance(alignment, BestFit) and not alignment.regions:
        rms_mm = _rms(placed.start.closest.distance, _inliers(placed) * weights)
        return Found(T, rms_mm, rms_mm, 0, np.zeros(3))
    chosen = _chosen(placed, weights)
    points, w = placed.scan.vertices[chosen], weights[chosen]
    rms_of: list[float] = []
    for number in range(1, MAX_STEPS + 1):
        moved = rigid.transformed(T, points)
        closest = placed.surface.closest(moved)
        inside = closest.distance <= placed.inlier_mm
        if inside.sum() < MIN_VERTICES:
            raise AlignmentFailed(sentence("the scan shows too little of the surface that it fits"))
        residual = np.einsum("kd,kd->k", moved - closest.point, closest.normal)
        rms_of.append(_rms(residual, w * inside))
        motions = _allowed(alignment, T, placed.start.T_design_scan, moved, w * inside)
        made = step(moved, closest.normal, residual, w * inside, motions)
        is_last = _moved_mm(made.motion, moved) < LAST_STEP_SHARE * placed.inlier_mm
        if is_last or _stalls(rms_of):
            pose_error = of_surface_fit(
                *(closest.point, closest.normal, residual, w * inside, _edge_mm(placed)), motions
            )
            return Found(T, rms_of[-1], rms_of[0], number, motions.centre, made.free, pose_error=pose_error)
        T = rigid.orthonormal(made.motion @ T)
    raise AlignmentFailed(
        sentence(
            "its fit did not settle in {count} steps; the surfaces or points may leave a motion nearly free",
            count=MAX_STEPS,
        )
    )


def fit_tolerances(
    placed: Placed, alignment: ToleranceFit, acceptance: Acceptance | None, tolerance_mm: float | None
) -> Found:
    """The least area-weighted square sum of what is beyond the limits; where all is within, near the best
    fit.
    """
    T, chosen = placed.start.T_design_scan, _chosen(placed, placed.weights)
    points, w = placed.scan.vertices[chosen], placed.weights[chosen] / placed.weights[chosen].sum()
    lower, upper = (
        each[chosen] for each in _limits(placed, alignment, acceptance, Limits(tolerance_mm=tolerance_mm))
    )
    margin = MARGIN_SHARE * np.where(np.isfinite(upper - lower), upper - lower, 0.0)
    rms_of: list[float] = []
    for number in range(1, MAX_STEPS + 1):
        moved = rigid.transformed(T, points)
        closest = placed.surface.closest(moved)
        signed = placed.surface.signed_distance(moved, closest)
        inside = closest.distance <= placed.inlier_mm
        rms_of.append(_rms(_beyond(signed, lower, upper), w * inside))
        along = _outward(moved, closest.point, signed, closest.normal)
        motion = _into_limits(moved, along, signed, w * inside, lower + margin, upper - margin)
        is_last = _moved_mm(motion, moved) < LAST_STEP_SHARE * placed.inlier_mm
        if is_last or (rms_of[-1] > 0 and _stalls(rms_of)):
            return Found(T, rms_of[-1], rms_of[0], number, np.zeros(3))
        T = rigid.orthonormal(motion @ T)
    raise AlignmentFailed(
        sentence(
            "its fit did not settle in {count} steps; the surfaces or points may leave a motion nearly free",
            count=MAX_STEPS,
        )
    )


def _into_limits(
    moved: FloatArray,
    along: FloatArray,
    signed: FloatArray,
    w: FloatArray,
    lower: FloatArray,
    upper: FloatArray,
) -> FloatArray:
    """(4, 4) the motion of the least cost on fixed closest points: damped Newton, of a convex cost."""
    start, motion = moved, np.eye(4)

    def cost_mm2(T: FloatArray) -> tuple[float, FloatArray, FloatArray]:
        now = signed + np.einsum("kd,kd->k", rigid.transformed(T, start) - start, along)
        beyond = _beyond(now, lower, upper)
        cost = float((w * (beyond**2 + WITHIN_WEIGHT * now**2)).sum())
        return cost, now, beyond

    cost, now, beyond = cost_mm2(motion)
    for _ in range(INNER_STEPS):
        here = rigid.transformed(motion, start)
        outside = beyond != 0
        # One row where the vertex is between its limits, and the sum of both squares as one row beyond them
        weights = w * (outside + WITHIN_WEIGHT)
        residual = (np.where(outside, beyond, 0.0) + WITHIN_WEIGHT * now) / (outside + WITHIN_WEIGHT)
        centre = np.einsum("k,kd->d", w / w.sum(), here)
        made = step(here, along, residual, weights, AllowedMotions(None, centre), determined_share=1e-9)
        for halving in range(HALVINGS):
            part = rigid.share_of(made.motion, centre, 0.5**halving)
            trial, now_there, beyond_there = cost_mm2(part @ motion)
            if trial < cost:
                break
        else:
            break
        is_last = cost - trial < 1e-9 * cost
        motion, cost, now, beyond = part @ motion, trial, now_there, beyond_there
        if is_last:
            break
    return motion


def _beyond(signed: FloatArray, lower: FloatArray, upper: FloatArray) -> FloatArray:
    return np.maximum(signed - upper, 0.0) + np.minimum(signed - lower, 0.0)


def _outward(moved: FloatArray, foot: FloatArray, signed: FloatArray, normal: FloatArray) -> FloatArray:
    """(k, 3) unit directions in which the signed distance grows."""
    apart = np.abs(signed) > 1e-9
    straight = (moved - foot) / np.where(apart, signed, 1.0)[:, None]
    outward: FloatArray = np.where(apart[:, None], straight, normal)
    return outward


def _limits(
    placed: Placed, alignment: ToleranceFit, acceptance: Acceptance | None, tolerance: Limits
) -> tuple[FloatArray, FloatArray]:
    """(n,) lower and upper limit of each scan vertex, by its place under the automatic pose."""
    n = len(placed.scan.vertices)
    lower, upper = np.full(n, -np.inf), np.full(n, np.inf)

    def put(limits: Limits, members: BoolArray) -> None:
        lower[members] = -np.inf if limits.lower is None else limits.lower
        upper[members] = np.inf if limits.upper is None else limits.upper

    everywhere: BoolArray = np.ones(n, dtype=np.bool_)
    if alignment.are_given:
        put(alignment, everywhere)
        return lower, upper
    put(tolerance if acceptance is None or not acceptance.are_given else acceptance, everywhere)
    for each in acceptance.regions if acceptance is not None else []:
        if each.are_given:
            put(each, _members(placed, each.region, each.name))
    return lower, upper


def _members(placed: Placed, region: Region, name: str) -> BoolArray:
    """(n,) whether a scan vertex has its place in the region, under the automatic pose."""
    closest = placed.start.closest
    on_design = (placed.segment_of_face, placed.surface, placed.brep)
    return regions.members(region, name, closest.point, closest.face, *on_design)


def _weights(placed: Placed, alignment: BestFit | ConstrainedFit) -> FloatArray:
    """(n,) area times the weight of the region that the vertex lies in under the automatic pose; of several
    the last.
    """
    if not alignment.regions:
        return placed.weights
    factor: FloatArray = np.full(len(placed.weights), float(alignment.other_weight))
    for number, each in enumerate(alignment.regions):
        factor[_members(placed, each.region, f"alignment.regions[{number}]")] = each.weight
    return placed.weights * factor


def _chosen(placed: Placed, weights: FloatArray) -> FloatArray:
    """(k,) vertices that are fitted."""
    near = np.flatnonzero((weights > 0) & _inliers(placed))
    if len(near) < MIN_VERTICES:
        raise AlignmentFailed(sentence("the scan shows too little of the surface that it fits"))
    return np.asarray(near[:: -(-len(near) // MAX_VERTICES)])


def _inliers(placed: Placed) -> BoolArray:
    return np.asarray(placed.start.closest.distance <= placed.inlier_mm)


def _allowed(
    alignment: BestFit | ConstrainedFit,
    T: FloatArray,
    T_start: FloatArray,
    moved: FloatArray,
    weights: FloatArray,
) -> AllowedMotions:
    """The motions that are not held, about a centre for which they stay so over many steps."""
    middle = np.einsum("k,kd->d", weights / weights.sum(), moved)
    if isinstance(alignment, BestFit):
        return AllowedMotions(None, middle)
    if alignment.hold is not None:
        about = np.array(alignment.about_mm or [0.0, 0.0, 0.0])
        # The point of the part that was there in the automatic pose: its held translations stay what they are
        now = rigid.transformed(T @ rigid.inverse(T_start), about[None])[0]
        free = [index for index, name in enumerate(_HELD) if name not in alignment.hold]
        return AllowedMotions(np.eye(6)[:, free], now)
    if alignment.line is not None:
        along = _unit(alignment.line.direction)
        basis = np.zeros((6, 2))
        basis[:3, 0], basis[3:, 1] = along, along
        return AllowedMotions(basis, np.array(alignment.line.point_mm, dtype=np.float64))
    assert alignment.plane is not None  # noqa: S101 (for mypy: exactly one of the three is given)
    normal = _unit(alignment.plane.normal)
    basis = np.zeros((6, 3))
    basis[:3, 0] = normal
    basis[3:, 1:] = np.linalg.svd(normal[None])[2][1:].T
    return AllowedMotions(basis, middle)


def _unit(direction: list[float]) -> FloatArray:
    vector = np.array(direction, dtype=np.float64)
    return np.asarray(vector / np.linalg.norm(vector))


def _edge_mm(placed: Placed) -> float:
    return patch_edge_mm(placed.scan, placed.surface.mesh.diagonal_mm)


def _rms(values: FloatArray, weights: FloatArray) -> float:
    total = float(weights.sum())
    return float(np.sqrt((weights * values**2).sum() / total)) if total > 0 else 0.0


def _stalls(rms_of: list[float]) -> bool:
    """Whether the cost (the square) has not fallen for some steps: at sharp edges the closest triangles of
    some vertices change for ever.
    """
    if len(rms_of) <= STALL_ITERATIONS:
        return False
    return min(rms_of[-STALL_ITERATIONS:]) ** 2 > (1 - STALL_SHARE) * min(rms_of[:-STALL_ITERATIONS]) ** 2


def _moved_mm(motion: FloatArray, points: FloatArray) -> float:
    return rigid.rms_displacement(motion, np.eye(4), points)
