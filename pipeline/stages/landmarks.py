"""Landmarks: the vertices of each segment whose features stand out (PCA, Hotelling's T^2)."""

from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree
from scipy.stats import f as f_distribution

from pipeline.mesh import BoolArray, FloatArray, IndexArray, Mesh
from pipeline.settings import LandmarksSettings
from pipeline.stages.features import Features
from pipeline.stages.segmentation import Segmentation

COMPONENTS = 2  # A in eq. 3


@dataclass(frozen=True, slots=True)
class LandmarkSet:
    """Landmarks of one mesh, strongest first; `vertex` is of the working mesh.

    vertex : (k,); position_mm, normal : (k, 3); segment : (k,); t2, strength : (k,), strength = T^2 / limit;
    t2_all : (n,) T^2 of every working vertex, 0 where none was computed; limit_share : share beyond the limit
    """

    vertex: IndexArray
    position_mm: FloatArray
    normal: FloatArray
    segment: IndexArray
    t2: FloatArray
    strength: FloatArray
    t2_all: FloatArray
    limit_share: float


def landmarks(mesh: Mesh, segmentation: Segmentation, features: Features, settings: LandmarksSettings) -> LandmarkSet:
    """Eq. 3 in every segment: T^2 = t1^2 / lambda1 + t2^2 / lambda2 against A (n^2 - 1) / (n (n - A)) F_alpha.

    The default leaves out a zone along open borders (their curvature is false), gives none in a segment without
    relief, and keeps the strongest within `spacing_radii`.
    """
    n = len(mesh.vertices)
    t2 = np.zeros(n)
    strength = np.zeros(n)
    usable = features.border_distance_mm >= settings.border_distance_radii * features.radius_mm
    if not settings.include_halo:
        usable &= ~segmentation.halo
    for number in range(len(segmentation.centres)):
        members = np.flatnonzero((segmentation.labels == number) & usable)
        if len(members) < settings.min_segment_vertices or _is_flat(features, members, settings):
            continue
        scores = hotelling_t2(scaled(features.values[members], settings.standardize))
        t2[members] = scores
        strength[members] = scores / t2_limit(len(members), settings.confidence)
    beyond = np.flatnonzero(strength > 1)
    order = beyond[np.lexsort((beyond, -strength[beyond]))]
    kept = order[strongest_apart(mesh.vertices[order], settings.spacing_radii * features.radius_mm)]
    return LandmarkSet(
        kept,
        mesh.vertices[kept],
        mesh.vertex_normals()[kept],
        segmentation.labels[kept].astype(np.int64),
        t2[kept],
        strength[kept],
        t2,
        len(beyond) / n,
    )


def scaled(values: FloatArray, standardize: bool) -> FloatArray:
    """(k, 6) features ready for the PCA: centred, and by default each divided by its spread.

    l1..l3 share one scale, the root of their mean variance, so that turning the part only turns the vector and
    T^2 stays what it was; each feature's own scale makes the unit drop out.
    """
    centred = values - values.mean(axis=0)
    if not standardize:
        return np.asarray(centred, dtype=np.float64)
    spread = centred.std(axis=0)
    spread[3:] = np.sqrt(np.mean(spread[3:] ** 2))
    unit_free: FloatArray = np.divide(centred, spread, out=np.zeros_like(centred), where=spread > 0)
    return unit_free


def hotelling_t2(centred: FloatArray) -> FloatArray:
    """(k,) T^2 of the first two principal components (eq. 3); a component without variance counts nothing."""
    covariance = np.einsum("ki,kj->ij", centred, centred) / max(1, len(centred) - 1)
    variance, axes = np.linalg.eigh(covariance)
    variance, axes = variance[::-1][:COMPONENTS], axes[:, ::-1][:, :COMPONENTS]
    real = variance > 1e-14 * max(float(variance[0]), 1e-300)
    scores = centred @ axes[:, real]
    return np.asarray((scores**2 / variance[real]).sum(axis=1), dtype=np.float64)


def t2_limit(n: int, confidence: float) -> float:
    """A (n^2 - 1) / (n (n - A)) F_alpha(A, n - A)."""
    a = COMPONENTS
    return float(a * (n**2 - 1) / (n * (n - a)) * f_distribution.ppf(confidence, a, n - a))


def strongest_apart(points: FloatArray, radius_mm: float) -> IndexArray:
    """Of points in order of strength, the numbers of those with no kept stronger one within `radius_mm`."""
    if radius_mm == 0 or len(points) == 0:
        return np.arange(len(points))
    free: BoolArray = np.ones(len(points), dtype=np.bool_)
    neighbours = cKDTree(points).query_ball_point(points, radius_mm)
    kept = []
    for i in range(len(points)):
        if free[i]:
            kept.append(i)
            free[neighbours[i]] = False
    return np.array(kept, dtype=np.int64)


def _is_flat(features: Features, members: IndexArray, settings: LandmarksSettings) -> bool:
    relief = float(features.mean_curvature_per_mm[members].std()) * features.radius_mm
    return relief < settings.min_relief
