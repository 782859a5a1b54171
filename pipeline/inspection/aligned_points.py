"""Alignments to points: reference points (RPS, 3-2-1), and pairs of landmarks."""

from dataclasses import dataclass

import numpy as np
from scipy.spatial import KDTree

from pipeline.core.alignment import LandmarksFit, RpsFit, RpsPoint
from pipeline.core.errors import PointOffSurface
from pipeline.core.mesh import FloatArray, IndexArray
from pipeline.core.results import AlignedPoint
from pipeline.core.sentences import sentence
from pipeline.core.small_motions import free_motions
from pipeline.inspection.alignment_types import AlignmentFailed, Found, Placed
from pipeline.inspection.patches import Value, median_of
from pipeline.inspection.points import MIN_COSINE, MIN_VERTICES, facing
from pipeline.inspection.pose_error import PoseError, of_point_fit
from pipeline.kernels import rigid
from pipeline.kernels.constrained_fit import AllowedMotions, step
from pipeline.search.types import Matching

#: A step that moves the points by less (RMS) is the last: far below what is measured. Chosen by hand.
LAST_STEP_MM = 1e-6
MAX_STEPS = 200
#: Steps after which the vertices at each point, and their places, stay those of the last step: on the border
#: of its radius noise lets some come and go for ever. Later steps are made by a share, since the median may
#: be of one vertex before a step and of another after it. Chosen by hand: without noise two or three suffice.
FREE_STEPS, LATER_SHARE = 8, 0.5


@dataclass(frozen=True, slots=True, eq=False)
class _Site:
    """A reference point on the design. place, normal : (3,) of the surface; direction : (3,) unit"""

    point: RpsPoint
    place: FloatArray
    normal: FloatArray
    direction: FloatArray


def fit_reference_points(placed: Placed, alignment: RpsFit) -> Found:
    """The scan on the design at the points, each along its direction: exactly for six, else by least squares.

    Raises
    ------
    PointOffSurface
        When no surface of the design that its direction crosses is within the radius of a point.
    AlignmentFailed
        When the scan does not show one of them.
    """
    sites = [_site(each, placed) for each in alignment.points]
    places, along = (np.array([getattr(each, of) for each in sites]) for of in ("place", "direction"))
    T, before = placed.start.T_design_scan, None
    centre, tree = places.mean(axis=0), KDTree(placed.scan.vertices)
    there: list[_There | None] = []
    for number in range(1, MAX_STEPS + 1):
        if number <= FREE_STEPS:
            there = [_there(each, placed, tree, T) for each in sites]
        found = [_offset(*each, placed, T) for each in zip(sites, there, strict=True)]
        residual = np.array([np.nan if value is None else value.median_mm for value in found])
        before = residual if before is None else before
        points = _records(sites, before, residual, found)
        if unseen := [each.name for each in points if each.value_mm is None]:
            names = ", ".join(repr(name) for name in unseen)
            raise AlignmentFailed(sentence("the scan does not show its points {names}", names=names), points)
        made = step(places, along, residual, np.ones(len(sites)), AllowedMotions(None, centre))
        if rigid.rms_displacement(made.motion, np.eye(4), places) < LAST_STEP_MM:
            errors = np.array([0.0 if each is None else each.error_mm or 0.0 for each in found])
            pose_error = of_point_fit(places, along, errors)
            return Found(T, _rms(residual), _rms(before), number, centre, made.free, points, pose_error)
        share = 1.0 if number <= FREE_STEPS else LATER_SHARE
        T = rigid.orthonormal(rigid.share_of(made.motion, centre, share) @ T)
    raise AlignmentFailed(
        sentence(
            "its fit did not settle in {count} steps; the surfaces or points may leave a motion nearly free",
            count=MAX_STEPS,
        ),
        points,
    )


def _site(point: RpsPoint, placed: Placed) -> _Site:
    direction = np.array(point.direction, dtype=np.float64) / np.linalg.norm(point.direction)
    sides = [
        on.closest(np.array([point.position_mm], dtype=np.float64))
        for on in (facing(placed.surface, sign * direction) for sign in (1.0, -1.0))
        if on is not None
    ]
    closest = min(sides, key=lambda each: float(each.distance[0]), default=None)
    if closest is None or closest.distance[0] > point.radius_mm:
        away = "" if closest is None else f" ({closest.distance[0]:.3g} mm off)"
        raise PointOffSurface(
            f"alignment point {point.name!r}: within its radius_mm of {point.radius_mm:g} there is no "
            f"surface of the design that its direction crosses{away}",
            mesh="design",
        )
    return _Site(point, closest.point[0], closest.normal[0], direction)


@dataclass(frozen=True, slots=True, eq=False)
class _There:
    """Vertices (k,) of the scan at a reference point, and their places and normals (k, 3) on the design."""

    vertices: IndexArray
    place: FloatArray
    normal: FloatArray


def _there(site: _Site, placed: Placed, tree: KDTree, T_design_scan: FloatArray) -> _There | None:
    """What the scan shows at the point; None where it shows too little.

    tree : of the vertices of the scan
    """
    T_scan_design = rigid.inverse(T_design_scan)
    # only vertices that can have their closest place near the point
    at = rigid.transformed(T_scan_design, site.place[None])[0]
    reach = site.point.radius_mm + placed.inlier_mm
    near = np.array(tree.query_ball_point(at, reach, return_sorted=True), dtype=np.int64)
    if len(near) < MIN_VERTICES:
        return None
    moved = rigid.transformed(T_design_scan, placed.scan.vertices[near])
    closest = placed.surface.closest(moved)
    kept = np.linalg.norm(closest.point - site.place, axis=1) <= site.point.radius_mm
    kept &= closest.normal @ site.normal >= MIN_COSINE
    kept &= closest.distance <= placed.inlier_mm
    if kept.sum() < MIN_VERTICES:
        return None
    return _There(near[kept], closest.point[kept], closest.normal[kept])


def _offset(site: _Site, there: _There | None, placed: Placed, T_design_scan: FloatArray) -> Value | None:
    """How far the scan is from the place of the design, along the direction; None where it shows none."""
    if there is None:
        return None
    moved = rigid.transformed(T_design_scan, placed.scan.vertices[there.vertices])
    height = np.einsum("kd,kd->k", moved - there.place, there.normal)
    crossing = there.normal @ site.direction
    return median_of(
        height / np.where(np.abs(crossing) < MIN_COSINE, np.sign(crossing) * MIN_COSINE, crossing),
        placed.inflation,
    )


def _records(
    sites: list[_Site], before: FloatArray, residual: FloatArray, found: list[Value | None]
) -> tuple[AlignedPoint, ...]:
    return tuple(
        AlignedPoint(
            name=site.point.name,
            position_mm=site.place.tolist(),
            best_fit_mm=None if np.isnan(at_start) else float(at_start),
            value_mm=None if value is None else float(now),
            n=None if value is None else value.n,
        )
        for site, at_start, now, value in zip(sites, before, residual, found, strict=True)
    )


@dataclass(frozen=True, slots=True, eq=False)
class Landmarks:
    """Those of both meshes, each in its own frame, (k, 3) mm, and their matches."""

    matching: Matching
    design_mm: FloatArray
    scan_mm: FloatArray


def fit_landmarks(placed: Placed, alignment: LandmarksFit, landmarks: Landmarks) -> Found:
    """The least-squares motion between pairs of places: those given, or matched landmarks."""
    T_best = placed.start.T_design_scan
    if alignment.pairs:
        names = [each.name for each in alignment.pairs]
        design, scan = (
            np.array([getattr(each, of) for each in alignment.pairs], dtype=np.float64)
            for of in ("design_mm", "scan_mm")
        )
    else:
        wanted, matching = alignment.design_landmarks, landmarks.matching
        used = [
            k for k, number in enumerate(matching.design.tolist()) if wanted is None or number in set(wanted)
        ]
        names = [str(number) for number in matching.design[used].tolist()]
        design = landmarks.design_mm[matching.design[used]]
        scan = landmarks.scan_mm[matching.scan[used]]
    axes = np.tile(np.eye(3), (len(names), 1)).tolist()
    free = free_motions(np.repeat(design, 3, axis=0).tolist(), axes) if names else []
    if free or len(names) < 3:
        still = "; ".join(str(motion) for motion in free) or "every motion"
        raise AlignmentFailed(
            sentence(
                "the matched landmarks that it uses ({count}) leave a motion free: {motion}",
                count=len(names),
                motion=still,
            )
        )
    T = rigid.fit(scan, design)
    before, after = (np.linalg.norm(rigid.transformed(each, scan) - design, axis=1) for each in (T_best, T))
    points = tuple(
        AlignedPoint(name=name, position_mm=place, best_fit_mm=float(a), value_mm=float(b), n=None)
        for name, place, a, b in zip(names, design.tolist(), before, after, strict=True)
    )
    return Found(
        *(T, _rms(after), _rms(before), 1, design.mean(axis=0)),
        points=points,
        pose_error=_of_pairs(design, after),
    )


def _of_pairs(design: FloatArray, residual_mm: FloatArray) -> PoseError | None:
    """By the residuals of the pairs: three for each, less the six unknowns."""
    k = len(design)
    sigma_mm = float(np.sqrt((residual_mm**2).sum() / max(3 * k - 6, 1)))
    axes = np.tile(np.eye(3), (k, 1))
    return of_point_fit(np.repeat(design, 3, axis=0), axes, np.full(3 * k, sigma_mm))


def _rms(values: FloatArray) -> float:
    return float(np.sqrt((values**2).mean()))
