"""Segmentation of the surface by density peaks (CFSFDP with geodesic distances)."""

from dataclasses import dataclass, replace

import numpy as np

from pipeline.core.errors import ComponentsTooSmall
from pipeline.core.mesh import BoolArray, FloatArray, IndexArray, IntArray, Mesh
from pipeline.core.settings import SegmentationSettings
from pipeline.kernels import clusterings, density_peaks, topology
from pipeline.kernels.nearest import nearest
from pipeline.stages.geodesics import Geodesics

#: Max number of density peaks before they are merged; limits memory. Chosen by hand; not fitted.
MAX_PEAKS = 1000


@dataclass(frozen=True, slots=True)
class Segmentation:
    """On the working mesh; rho and delta are the decision graph.

    labels : (n,) int32 >= 0; halo : (n,); rho : (n,) vertices or mm^2; delta : (n,) mm, finite;
    centres : (k,) int64, centre of segment s at `centres[s]`, largest rho * delta first (other methods than
    cfsfdp: largest segment first); d_c_mm
    """

    labels: IntArray
    halo: BoolArray
    rho: FloatArray
    delta: FloatArray
    centres: IndexArray
    d_c_mm: float


def segment(
    mesh: Mesh, name: str, geodesics: Geodesics, settings: SegmentationSettings, seed: int = 0
) -> Segmentation:
    """Rodriguez & Laio 2014 on `mesh`; another `settings.method` then relabels by position, see `clustered`.

    mesh : the working mesh, n vertices. Each component has at least one centre, its densest vertex. A
    component below `min_component_share` of the area has no centre: its vertices join the segment nearest in
    space, as halo.

    Raises
    ------
    ComponentsTooSmall
    """
    solver, d_c = geodesics.solver, geodesics.d_c_mm
    areas = mesh.vertex_areas_mm2()
    rho = geodesics.rho  # eq. 1
    if settings.kernel == "gaussian":
        rho = solver.density(d_c, geodesics.weights, gaussian=True)
    nearest_denser, delta = solver.nearest_denser(rho)  # eq. 2

    component_area = np.bincount(solver.components, weights=areas)
    large = component_area >= settings.min_component_share * component_area.sum()
    peaks = np.flatnonzero(nearest_denser < 0)  # the densest vertex of each component: delta = max_j d
    for peak in peaks:
        reach = solver.distances(int(peak))
        delta[peak] = reach[np.isfinite(reach)].max()
    if not large.any():
        raise ComponentsTooSmall(
            f"the largest of {len(component_area)} connected components has "
            f"{component_area.max() / component_area.sum():.2%} of the area; at least "
            f"{settings.min_component_share:.2%} is required",
            mesh=name,
        )
    eligible = large[solver.components]
    graph = DecisionGraph(
        np.where(eligible, rho, 0.0), np.where(eligible, delta, 0.0), peaks[eligible[peaks]]
    )
    centres, labels = _centres(mesh, graph, nearest_denser, d_c, settings)
    halo = density_peaks.halo(
        rho, labels, len(centres), lambda vertices: np.isfinite(solver.nearest_other(vertices, labels, d_c))
    )
    unassigned = labels < 0
    if unassigned.any():
        _, host = nearest(mesh.vertices[~unassigned], mesh.vertices[unassigned])
        labels[unassigned] = labels[~unassigned][host]
        halo = halo | unassigned
    found = Segmentation(labels, halo, rho, delta, centres, d_c)
    return found if settings.method == "cfsfdp" else clustered(mesh, found, settings, seed)


@dataclass(frozen=True, slots=True)
class DecisionGraph:
    """rho, delta : (n,), 0 for vertices that cannot be centres; forced : densest vertex of each large
    component.
    """

    rho: FloatArray
    delta: FloatArray
    forced: IndexArray


def _centres(
    mesh: Mesh, graph: DecisionGraph, nearest_denser: IndexArray, d_c: float, settings: SegmentationSettings
) -> tuple[IndexArray, IntArray]:
    """Centres, largest rho * delta first, and the label of every vertex (-1: no centre above it).

    Thresholds of the user (`rho_min`, `delta_min_mm`) have priority. Otherwise peaks are merged over dense
    borders until each has the min prominence, or thresholds of the decision graph select them.
    """
    by_user = settings.rho_min is not None or settings.delta_min_mm is not None
    joins = settings.centre_rule == "prominence" and not by_user
    if by_user:
        delta_min, rho_min = settings.delta_min_mm or 0.0, settings.rho_min or 0.0
    elif joins:
        delta_min, rho_min = d_c, 0.0
    else:
        delta_min, rho_min = settings.delta_min_dc * d_c, settings.rho_min_share * float(np.median(graph.rho))
    centres = density_peaks.choose_centres(
        graph.rho,
        graph.delta,
        graph.forced,
        delta_min=delta_min,
        rho_min=rho_min,
        max_centres=MAX_PEAKS if joins or by_user else settings.max_centres,
        n_centres=None if joins or by_user else settings.n_centres,
    )
    labels = density_peaks.assign(nearest_denser, centres)
    if not joins:
        return centres, labels
    return density_peaks.persistent_centres(
        graph.rho,
        labels,
        centres,
        topology.edges(mesh.faces).ends,
        min_prominence=settings.min_prominence,
        n_centres=settings.n_centres,
    )


def clustered(mesh: Mesh, peaks: Segmentation, settings: SegmentationSettings, seed: int) -> Segmentation:
    """The segmentation by another clustering method, with the decision graph of the density peaks.

    The number of segments is `n_centres`, or that of the density peaks. No vertex is halo.
    """
    k = settings.n_centres or len(peaks.centres)
    found = clusterings.cluster(settings.method, mesh.vertices, mesh.vertex_areas_mm2(), k, seed)
    return replace(peaks, labels=found.labels, halo=np.zeros_like(peaks.halo), centres=found.centres)
