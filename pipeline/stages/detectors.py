"""Keypoint detectors that T^2 is compared with, selected by the setting `landmarks.detector`.

A detector ranks all vertices: first the keypoints of its publication, then the other vertices by the same
measure. `stages/landmarks.py` selects from this ranking the keypoints away from open borders and from
stronger ones. The parameters are those of the publications or of the authors' code, named in the kernels;
none was fitted to our meshes.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from pipeline.core.mesh import BoolArray, FloatArray, IndexArray, Mesh
from pipeline.core.settings import Detector
from pipeline.kernels import gp_landmarks, heat_kernel, iss, maxima, peaks, topology
from pipeline.kernels.average_geodesic import average_geodesic
from pipeline.kernels.farthest import farthest_points
from pipeline.kernels.geodesics import GeodesicSolver
from pipeline.kernels.nearest import nearest
from pipeline.stages.features import Features

#: Radius of the fit that locates a maximum, in feature radii. Chosen by hand; not fitted.
REACH_RADII = 0.3
#: Greedily chosen points for each requested one: borders and spacing remove some. Chosen by hand; not fitted.
SPARE = 3


@dataclass(frozen=True, slots=True)
class DetectorInput:
    """Input of a detector.

    mesh : the working mesh; surface : geodesic distances on it; features : on their own, finer mesh; count :
    number of keypoints requested; spacing_mm : min distance between them; seed : of random draws
    """

    mesh: Mesh
    surface: GeodesicSolver
    features: Features
    count: int
    spacing_mm: float
    seed: int


@dataclass(frozen=True, slots=True)
class RankedKeypoints:
    """All usable vertices, best keypoint first.

    vertex : (k,) of `mesh`; strength : (k,) descending, dimensionless; position_mm : (k, 3), the vertex, or
    the located maximum of a field between vertices
    """

    mesh: Mesh
    vertex: IndexArray
    strength: FloatArray
    position_mm: FloatArray


Detect = Callable[[DetectorInput], RankedKeypoints]


def gaussian_curvature(data: DetectorInput) -> RankedKeypoints:
    """Local maxima of the Gaussian curvature averaged over the feature radius, the largest first. Not on an
    open border, where a vertex has no curvature of its own.
    """
    mesh = data.features.mesh
    on_border = topology.border_vertices(mesh.faces, len(mesh.vertices))
    field = np.where(on_border, -np.inf, data.features.gaussian_curvature_per_mm2)
    return _by_maxima(data, mesh, field)


def agd(data: DetectorInput) -> RankedKeypoints:
    """Local maxima of the average geodesic distance: the tips of the part."""
    areas = data.mesh.vertex_areas_mm2()
    return _by_maxima(data, data.mesh, average_geodesic(data.mesh.vertices, areas, data.surface))


def hks(data: DetectorInput) -> RankedKeypoints:
    """Local maxima in the 2-ring of the heat kernel signature, those of the longest diffusion time first."""
    fields = heat_kernel.signatures(data.mesh, data.surface.components)
    fields[~_with_area(data.mesh)] = -np.inf
    near = maxima.ring(data.mesh.faces, len(fields), rings=2)
    tops = np.stack([maxima.local_maxima(field, near) for field in fields.T], axis=1)
    found = _candidates(data.mesh, maxima.coarse_to_fine(fields, tops))
    positions = data.mesh.vertices.copy()
    for field, top in zip(
        fields.T[::-1], tops.T[::-1], strict=True
    ):  # the coarsest scale of a vertex overrides the others
        positions[top] = _between_vertices(data, data.mesh, field, np.flatnonzero(top))
    return replace(found, position_mm=positions[found.vertex])


def iss_keypoints(data: DetectorInput) -> RankedKeypoints:
    """ISS keypoints by saliency, then the other vertices by saliency."""
    members = np.flatnonzero(_with_area(data.mesh))
    found = iss.keypoints(data.mesh.vertices[members])
    return _candidates(data.mesh, maxima.ranked(found.saliency, found.keypoint), members)


def gp(data: DetectorInput) -> RankedKeypoints:
    """Gaussian process landmarks in the order of their choice, then the other vertices by their remaining
    variance.
    """
    members = np.flatnonzero(_with_area(data.mesh))
    points, areas = data.mesh.vertices[members], data.mesh.vertex_areas_mm2()
    weights = gp_landmarks.curvature_weights(
        areas[members], *(curvature[members] for curvature in _curvatures(data))
    )
    bandwidth = gp_landmarks.BANDWIDTH_EDGES * _mean_edge_mm(data.mesh) * float(np.sqrt(areas.sum()))
    phi = gp_landmarks.heat_factor(points, bandwidth)
    found = gp_landmarks.most_uncertain(phi, weights, min(SPARE * data.count, len(members)))
    rest = np.setdiff1d(np.arange(len(members)), found.taken)
    rest = rest[np.lexsort((rest, -found.left[rest]))]
    variance = np.concatenate([found.variance, found.left[rest]])
    ranking = maxima.Ranking(
        np.concatenate([found.taken, rest]), variance / max(float(variance.max(initial=0)), 1e-300)
    )
    return _candidates(data.mesh, ranking, members)


def farthest(data: DetectorInput) -> RankedKeypoints:
    """Farthest-point sampling along the surface, then the other vertices by their distance to the samples."""
    usable, areas = _with_area(data.mesh), data.mesh.vertex_areas_mm2()
    found = farthest_points(data.mesh.vertices, areas, data.surface, SPARE * data.count, usable)
    rest = np.setdiff1d(np.flatnonzero(usable), found.taken)
    rest = rest[np.lexsort((rest, -found.distance_mm[rest]))]
    return _candidates(data.mesh, maxima.by_turn(np.concatenate([found.taken, rest])))


def random(data: DetectorInput) -> RankedKeypoints:
    """All vertices in a random order, drawn one after another by area (Efraimidis & Spirakis 2006)."""
    members = np.flatnonzero(_with_area(data.mesh))
    waiting = np.random.default_rng(data.seed).exponential(size=len(members))
    waiting /= data.mesh.vertex_areas_mm2()[members]
    return _candidates(data.mesh, maxima.by_turn(members[np.argsort(waiting, kind="stable")]))


DETECTORS: dict[Detector, Detect] = {
    "gaussian_curvature": gaussian_curvature,
    "agd": agd,
    "hks": hks,
    "iss": iss_keypoints,
    "gp": gp,
    "farthest": farthest,
    "random": random,
}


def _by_maxima(data: DetectorInput, mesh: Mesh, field: FloatArray) -> RankedKeypoints:
    field = np.where(_with_area(mesh), field, -np.inf)
    tops = maxima.local_maxima(field, maxima.ring(mesh.faces, len(field)))
    found = _candidates(mesh, maxima.ranked(field, tops))
    positions = mesh.vertices.copy()
    positions[tops] = _between_vertices(data, mesh, field, np.flatnonzero(tops))
    return replace(found, position_mm=positions[found.vertex])


def _between_vertices(data: DetectorInput, mesh: Mesh, field: FloatArray, tops: IndexArray) -> FloatArray:
    """(k, 3) mm, maxima of the field between vertices, located as those of T^2."""
    finite = np.where(np.isfinite(field), field, np.min(field[np.isfinite(field)], initial=0.0))
    return peaks.located(mesh, finite, tops, REACH_RADII * data.features.radius_mm).position_mm


def _candidates(mesh: Mesh, found: maxima.Ranking, members: IndexArray | None = None) -> RankedKeypoints:
    """members : the vertices that `found.vertex` indexes; default all."""
    vertex = found.vertex if members is None else members[found.vertex]
    return RankedKeypoints(mesh, vertex, found.strength, mesh.vertices[vertex])


def _with_area(mesh: Mesh) -> BoolArray:
    """(n,) whether there is any surface at the vertex."""
    return np.asarray(mesh.vertex_areas_mm2() > 0, dtype=np.bool_)


def _mean_edge_mm(mesh: Mesh) -> float:
    ends = topology.edges(mesh.faces).ends
    along = mesh.vertices[ends[:, 1]] - mesh.vertices[ends[:, 0]]
    return float(np.linalg.norm(along, axis=1).mean()) if len(ends) else 0.0


def _curvatures(data: DetectorInput) -> tuple[FloatArray, FloatArray]:
    """(n,) Gaussian and mean curvature at the vertices of the working mesh."""
    _, at = nearest(data.features.mesh.vertices, data.mesh.vertices)
    return data.features.gaussian_curvature_per_mm2[at], data.features.mean_curvature_per_mm[at]
