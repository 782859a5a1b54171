"""Landmarks: points with outlying features (PCA, Hotelling's T^2), or the keypoints of another detector."""

from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree
from scipy.stats import f as f_distribution

from pipeline.core.landmark_set import LandmarkSet
from pipeline.core.mesh import BoolArray, FloatArray, IndexArray, IntArray, Mesh
from pipeline.core.settings import LandmarksSettings
from pipeline.kernels import maxima, peaks
from pipeline.kernels.geodesics import GeodesicSolver
from pipeline.kernels.nearest import nearest
from pipeline.stages.detectors import DETECTORS, DetectorInput
from pipeline.stages.features import Features
from pipeline.stages.resample import nearest_vertices
from pipeline.stages.segmentation import Segmentation

#: Principal components in T^2, A in eq. 3; from the paper.
COMPONENTS = 2
#: Estimates of centre and covariance: of all vertices, then without the outliers of the first. Chosen by
#: hand; not fitted.
ROBUST_ROUNDS = 2
#: Confidence of the limit beyond which a vertex is an outlier in that estimate. Chosen by hand; not fitted.
ROBUST_CONFIDENCE = 0.975
#: A variance below this share of the largest one is rounding. Chosen by hand.
MIN_VARIANCE_SHARE = 1e-14


@dataclass(frozen=True, slots=True)
class Scores:
    """T^2 of the n vertices of the feature mesh.

    t2 : (n,) scaled by the variance of the segment, 0 if not computed; limit : (n,) of the segment, inf if
    the segment gives no landmarks; field : (n,) the field whose maxima are landmarks, comparable between
    segments if `statistics` is "part"
    """

    t2: FloatArray
    limit: FloatArray
    field: FloatArray


@dataclass(frozen=True, slots=True)
class Keypoints:
    """Keypoints, strongest first. vertex : (k,) of `mesh`; position_mm : (k, 3); strength : (k,)
    dimensionless.
    """

    mesh: Mesh
    vertex: IndexArray
    position_mm: FloatArray
    strength: FloatArray


def landmarks(
    mesh: Mesh,
    surface: GeodesicSolver,
    segmentation: Segmentation,
    features: Features,
    settings: LandmarksSettings,
    seed: int = 0,
) -> LandmarkSet:
    """Keypoints of `settings.detector` away from open borders and from stronger ones; at most `count`.

    mesh, surface, segmentation : the working mesh; features : on their own, finer mesh
    """
    fine = features.mesh
    of_fine = np.arange(len(mesh.vertices)) if fine is mesh else nearest_vertices(mesh, fine.vertices)
    scores = t2_scores(features, segmentation.labels[of_fine], segmentation.halo[of_fine], settings)
    spacing_mm = settings.spacing_radii * features.radius_mm
    found = _apart(_t2_keypoints(features, scores, settings), features, spacing_mm, settings)
    if settings.detector != "t2":
        count = settings.count or len(found.vertex)
        detector_input = DetectorInput(mesh, surface, features, count, spacing_mm, seed)
        found = _apart(
            _detect(detector_input, settings),
            features,
            spacing_mm,
            settings.model_copy(update={"count": count}),
        )

    _, to_fine = nearest(fine.vertices, mesh.vertices)
    _, vertex = nearest(mesh.vertices, found.position_mm)
    _, at = nearest(fine.vertices, found.position_mm)
    return LandmarkSet(
        vertex=vertex,
        position_mm=found.position_mm,
        normal=mesh.vertex_normals()[vertex],
        segment=segmentation.labels[vertex].astype(np.int64),
        t2=scores.t2[at],
        strength=found.strength,
        t2_all=scores.t2[to_fine],
        limit_share=float((scores.t2 > scores.limit).mean()),
    )


def t2_scores(
    features: Features, labels: IntArray | IndexArray, halo: BoolArray, settings: LandmarksSettings
) -> Scores:
    """Eq. 3 in every segment: T^2 = t1^2 / lambda1 + t2^2 / lambda2 against A (n^2 - 1) / (n (n - A))
    F_alpha.

    labels : (n,) segment of each vertex of the features' mesh; halo : (n,)

    `statistics = "segment"` (paper): centre and covariance of each segment. "part": directions and ratio of
    the variances are those of the whole part, area-weighted and without the outermost 2.5 %. The variance of
    a segment scales T^2 where it is smaller. The segments of two scans of a part have slightly different
    borders, so statistics of few vertices differ; a field over the whole part has no jumps at borders. Its
    features are m, G and |l|, which are invariant to rotation and, divided by their spread, to the unit
    (physical `a` adds no information). A segment without relief gives no landmarks. A segment with few
    vertices uses the variance of the part.
    """
    n = len(labels)
    usable = features.border_distance_mm >= settings.border_distance_radii * features.radius_mm
    if not settings.include_halo:
        usable &= ~halo
    part = _part_t2(features, usable) if settings.statistics == "part" else np.zeros(n)
    areas = features.mesh.vertex_areas_mm2()
    t2, limit = np.zeros(n), np.full(n, np.inf)
    for number in range(int(labels.max(initial=-1)) + 1):
        members = np.flatnonzero((labels == number) & usable)
        few = len(members) < settings.min_segment_vertices
        if (
            (few and settings.statistics == "segment")
            or len(members) == 0
            or _is_flat(features, members, settings)
        ):
            continue
        if settings.statistics == "part":
            size = 1.0 if few else float(np.average(part[members], weights=areas[members])) / COMPONENTS
            t2[members] = part[members] / min(1.0, max(size, 1e-12))
        else:
            t2[members] = hotelling_t2(scaled(features.values[members], settings.standardize))
        limit[members] = t2_limit(max(len(members), settings.min_segment_vertices), settings.confidence)
    field = (
        part
        if settings.statistics == "part"
        else np.divide(t2, limit, out=np.zeros(n), where=np.isfinite(limit))
    )
    return Scores(t2, limit, field)


def scaled(values: FloatArray, standardize: bool) -> FloatArray:
    """(k, 6) features ready for the PCA: centred, and if `standardize`, divided by their spread.

    values : (k, 6). l1, l2, l3 share one scale, the root of their mean variance, so T^2 does not change when
    the part is rotated. The scale of each feature removes its unit.
    """
    centred = values - values.mean(axis=0)
    if not standardize:
        return np.asarray(centred, dtype=np.float64)
    spread = centred.std(axis=0)
    spread[3:] = np.sqrt(np.mean(spread[3:] ** 2))
    unit_free: FloatArray = np.divide(centred, spread, out=np.zeros_like(centred), where=spread > 0)
    return unit_free


def hotelling_t2(centred: FloatArray, weights: FloatArray | None = None) -> FloatArray:
    """(k,) T^2 of the first two principal components (eq. 3); a component without variance is ignored.

    weights : (k,) weight of each row in the covariance; default equal
    """
    if weights is None:
        covariance = np.einsum("ki,kj->ij", centred, centred) / max(1, len(centred) - 1)
    else:
        covariance = np.einsum("k,ki,kj->ij", weights, centred, centred) / max(float(weights.sum()), 1e-300)
    variance, axes = np.linalg.eigh(covariance)
    variance, axes = variance[::-1][:COMPONENTS], axes[:, ::-1][:, :COMPONENTS]
    real = variance > MIN_VARIANCE_SHARE * max(float(variance[0]), 1e-300)
    scores = centred @ axes[:, real]
    return np.asarray((scores**2 / variance[real]).sum(axis=1), dtype=np.float64)


def t2_limit(n: int, confidence: float) -> float:
    """A (n^2 - 1) / (n (n - A)) F_alpha(A, n - A)."""
    a = COMPONENTS
    return float(a * (n**2 - 1) / (n * (n - a)) * f_distribution.ppf(confidence, a, n - a))


def strongest_apart(points: FloatArray, radius_mm: float) -> IndexArray:
    """Indices of the points (k, 3), strongest first, without a selected stronger point within `radius_mm`."""
    if radius_mm == 0 or len(points) == 0:
        return np.arange(len(points))
    free: BoolArray = np.ones(len(points), dtype=np.bool_)
    tree = cKDTree(points)
    kept = []
    for i in range(len(points)):
        if free[i]:
            kept.append(i)
            free[tree.query_ball_point(points[i], radius_mm)] = False
    return np.array(kept, dtype=np.int64)


def _part_t2(features: Features, usable: BoolArray) -> FloatArray:
    """(n,) T^2 of [m, G, |l|] over the whole part; centre and covariance by area, once without the farthest
    2.5 %.
    """
    values = np.column_stack([features.values[:, 1:3], np.linalg.norm(features.values[:, 3:], axis=1)])
    weights = features.mesh.vertex_areas_mm2() * usable
    t2 = np.zeros(len(values))
    for _ in range(ROBUST_ROUNDS):
        if weights.sum() <= 0:
            return t2
        centred = values - np.average(values, axis=0, weights=weights)
        spread = np.sqrt(np.average(centred**2, axis=0, weights=weights))
        unit_free = np.divide(centred, spread, out=np.zeros_like(centred), where=spread > 0)
        t2 = hotelling_t2(unit_free, weights)
        weights = weights * (t2 <= t2_limit(max(len(values), 10), ROBUST_CONFIDENCE))
    return t2


def _t2_keypoints(features: Features, scores: Scores, settings: LandmarksSettings) -> Keypoints:
    """Vertices beyond the limit, strongest first; with `localize_radii` only maxima, located between
    vertices.
    """
    mesh = features.mesh
    beyond = np.flatnonzero(scores.t2 > scores.limit)
    if settings.localize_radii == 0:
        order = beyond[np.lexsort((beyond, -scores.field[beyond]))]
        return Keypoints(mesh, order, mesh.vertices[order], scores.field[order])
    near = maxima.ring(mesh.faces, len(mesh.vertices))
    tops = np.intersect1d(np.flatnonzero(maxima.local_maxima(scores.field, near)), beyond)
    # The square root is a distance in standard deviations; a quadric fits it better than its square.
    found = peaks.located(mesh, np.sqrt(scores.field), tops, settings.localize_radii * features.radius_mm)
    sharp = found.sharpness * features.radius_mm**2 > settings.min_sharpness * found.value
    order = np.flatnonzero(sharp)[np.argsort(-np.round(found.value[sharp], 9), kind="stable")]
    limit = t2_limit(len(mesh.vertices), settings.confidence)
    return Keypoints(mesh, tops[order], found.position_mm[order], found.value[order] ** 2 / limit)


def _detect(detector_input: DetectorInput, settings: LandmarksSettings) -> Keypoints:
    found = DETECTORS[settings.detector](detector_input)
    return Keypoints(found.mesh, found.vertex, found.position_mm, found.strength)


def _apart(
    keypoints: Keypoints, features: Features, spacing_mm: float, settings: LandmarksSettings
) -> Keypoints:
    """The keypoints away from open borders and at least `spacing_mm` from stronger ones; at most
    `settings.count`.
    """
    _, at = nearest(features.mesh.vertices, keypoints.position_mm)
    inside = np.flatnonzero(
        features.border_distance_mm[at] >= settings.border_distance_radii * features.radius_mm
    )
    kept = inside[strongest_apart(keypoints.position_mm[inside], spacing_mm)][: settings.count]
    return Keypoints(
        keypoints.mesh, keypoints.vertex[kept], keypoints.position_mm[kept], keypoints.strength[kept]
    )


def _is_flat(features: Features, members: IndexArray, settings: LandmarksSettings) -> bool:
    relief = float(features.mean_curvature_per_mm[members].std()) * features.radius_mm
    return relief < settings.min_relief
