"""The working mesh: the same surface in nearly equilateral triangles at the part's own scale.

A scan of a million triangles and a CAD part of 400 are analysed at the same resolution: the edge length
follows from the design's area and `target_vertices`, and the scan gets the same edge length. Results on the
working mesh are transferred to the cleaned mesh by the nearest surface point.
"""

from dataclasses import dataclass

import numpy as np
import open3d as o3d

from pipeline.core.errors import ResampleFailed
from pipeline.core.mesh import BoolArray, FloatArray, IndexArray, Mesh
from pipeline.core.settings import CleanSettings, ResampleSettings
from pipeline.kernels import isotropic, remesh
from pipeline.kernels.nearest import nearest
from pipeline.kernels.surface import Surface
from pipeline.stages.clean import clean

#: Min number of vertices of a working mesh. Chosen by hand; not fitted.
MIN_VERTICES = 500
#: A surface with more than this many times the requested triangles is decimated before remeshing, which would
#: otherwise be slow. Chosen by hand; not fitted.
DECIMATE_ABOVE = 8
#: Edges of the working mesh of a noisy scan are at most this share shorter than asked for (median). From the
#: requirement that a scan's noise costs no time.
EDGE_TOLERANCE = 0.2
#: Passes of remeshing, at most, of a surface whose triangles are already as small as asked for: passes beyond
#: these change less than 1 % of its vertices. Where nearly all edges (`NEARLY_ALL`) are shorter than
#: `SHORT_EDGES` times what is asked for. Chosen by hand; not fitted.
FEW_PASSES, NEARLY_ALL, SHORT_EDGES = 3, 0.99, 2.0
#: Neighbours for estimating the normals of a point cloud, and for orienting them. Chosen by hand; not fitted.
NORMAL_NEIGHBOURS, ORIENTATION_NEIGHBOURS = 20, 15
#: Min and max octree depth of the Poisson reconstruction. Chosen by hand; limits time and memory.
POISSON_DEPTHS = (4, 9)
#: Size of the octree over the extent of the cloud. Chosen by hand; not fitted.
POISSON_MARGIN = 1.2
#: Distance in point spacings beyond which a reconstructed triangle is removed. Chosen by hand; not fitted.
TRIM_SPACINGS = 2.5
#: Components below this share of the reconstructed area are removed. Chosen by hand; not fitted.
MIN_POISSON_COMPONENT_SHARE = 0.01
#: Shortest edge that may be left, over the length asked for. Chosen by hand: the remesher leaves none below a
#: tenth but where the surface is tangled.
TINY_EDGE = 0.01


@dataclass(frozen=True, slots=True)
class Resampled:
    """mesh : the working mesh; fine : the same surface in smaller triangles, for features, or None when not
    asked for; edge_mm : edge length of the working mesh; working_of_clean : (n_clean,) int64, nearest vertex
    of the working mesh (by the nearest surface point); light : the cleaned mesh in fewer triangles, None
    where it has few enough to be shown as it is
    """

    mesh: Mesh
    fine: Mesh | None
    edge_mm: float
    working_of_clean: IndexArray
    light: Mesh | None = None


def working_edge_mm(area_mm2: float, n_vertices: int) -> float:
    """Edge of `n_vertices` equilateral triangles' vertices covering `area_mm2` (each stands for sqrt(3)/2
    e^2).
    """
    return float(np.sqrt(2.0 * area_mm2 / (np.sqrt(3.0) * n_vertices)))


def resample(
    mesh: Mesh, name: str, edge_mm: float, settings: ResampleSettings, *, fine_edge_mm: float | None = None
) -> Resampled:
    """Remesh `mesh` (a cloud is meshed first) to edges of `edge_mm`, longer if that would be too many
    vertices, shorter if it would be next to none.

    fine_edge_mm : also remesh to this edge, changed by the same factor; without `settings.enabled` the fine
    mesh is the mesh itself.

    Raises
    ------
    ResampleFailed
    """
    if not settings.enabled and not mesh.is_cloud:
        return Resampled(mesh, None if fine_edge_mm is None else mesh, edge_mm, np.arange(len(mesh.vertices)))
    surface = surface_of_cloud(mesh.vertices, name, edge_mm) if mesh.is_cloud else mesh
    light = None
    noisy = remesh.is_noisy(surface)
    finest_mm = _allowed_edge_mm(surface, edge_mm, settings)
    finest_mm *= min(1.0, (fine_edge_mm or edge_mm) / edge_mm)
    # Noise adds to the area, so of a noisy surface the number of triangles asked for is taken.
    wanted = 2 * settings.target_vertices if noisy else _faces(_area_mm2(surface), finest_mm)
    if len(surface.faces) > remesh.MANY_FACES >= DECIMATE_ABOVE * wanted:
        surface = light = remesh.decimated(
            surface, remesh.MANY_FACES // 2
        )  # the slow step: pictures share it
    if noisy:
        surface = remesh.denoised(surface)
    area = _area_mm2(surface)  # without the noise, which adds to it
    longer = _allowed_edge_mm(surface, edge_mm, settings) / edge_mm
    fine = None
    if fine_edge_mm is not None:
        # Features want every crease: with fewer, 3 % fewer landmarks are found again.
        fine = _remeshed(surface, area, name, longer * fine_edge_mm, settings, noisy, for_features=True)
        if len(surface.faces) > DECIMATE_ABOVE * _faces(area, longer * edge_mm):
            surface = fine  # near enough for the coarser one, and remeshed in half the time
    working = _remeshed(surface, area, name, longer * edge_mm, settings, noisy)
    return Resampled(working, fine, longer * edge_mm, nearest_vertices(working, mesh.vertices), light)


def _allowed_edge_mm(surface: Mesh, edge_mm: float, settings: ResampleSettings) -> float:
    """`edge_mm`, or the nearest to it at which the working mesh has neither too few nor too many vertices."""
    area = _area_mm2(surface)
    # A scan far smaller than its design (in another unit, a splinter) keeps enough vertices to be looked at.
    shortest = working_edge_mm(area, int(settings.max_scan_ratio * settings.target_vertices))
    return max(min(edge_mm, working_edge_mm(area, MIN_VERTICES)), shortest)


def _area_mm2(surface: Mesh) -> float:
    return float(surface.face_areas_mm2().sum())


def _remeshed(
    surface: Mesh,
    area_mm2: float,
    name: str,
    edge_mm: float,
    settings: ResampleSettings,
    noisy: bool,
    *,
    for_features: bool = False,
) -> Mesh:
    """noisy : the surface was; where what is left of the noise still makes creases, none is kept;
    for_features : keep every crease
    """
    wanted = _faces(area_mm2, edge_mm)
    if len(surface.faces) > DECIMATE_ABOVE * wanted:
        surface = remesh.decimated(surface, int(DECIMATE_ABOVE / 2 * wanted))
    passes = settings.iterations
    if remesh.edge_mm(surface, NEARLY_ALL) <= SHORT_EDGES * edge_mm:
        passes = min(passes, FEW_PASSES)
    crease_deg = remesh.CREASE_DEG if for_features else None
    remeshed = isotropic.remeshed(surface, edge_mm, passes, crease_deg=crease_deg)
    too_fine = (1 - EDGE_TOLERANCE) * edge_mm
    if noisy and len(remeshed.faces) and remesh.edge_mm(remeshed, 0.5) < too_fine:
        remeshed = isotropic.remeshed(surface, edge_mm, passes, crease_deg=remesh.NO_CREASE_DEG)
    if len(remeshed.faces) == 0:
        raise ResampleFailed(f"remeshing to edges of {edge_mm:.3g} mm produced no triangles", mesh=name)
    remeshed = remesh.without_tiny_edges(remeshed, TINY_EDGE * edge_mm)
    return clean(remeshed, name, CleanSettings()).mesh


def _faces(area_mm2: float, edge_mm: float) -> float:
    """So many equilateral triangles cover the area."""
    return float(2 * area_mm2 / (np.sqrt(3.0) / 2 * edge_mm**2))


def nearest_vertices(mesh: Mesh, points: FloatArray) -> IndexArray:
    """(k,) for each point the corner with the largest weight at the closest point of the surface."""
    found = Surface(mesh).closest(points)
    return np.asarray(mesh.faces[found.face, found.weights.argmax(axis=1)], dtype=np.int64)


def surface_of_cloud(points: FloatArray, name: str, edge_mm: float) -> Mesh:
    """A surface reconstructed from scan points (screened Poisson), trimmed to the neighbourhood of the
    points.

    Used for analysis only. points : (n, 3) mm.

    Raises
    ------
    ResampleFailed
    """
    middle = (
        points.min(axis=0) + points.max(axis=0)
    ) / 2  # Qhull and Poisson round what is far from the origin
    cloud = o3d.geometry.PointCloud(o3d.utility.Vector3dVector(points - middle)).voxel_down_sample(
        edge_mm / 2
    )
    if len(cloud.points) < NORMAL_NEIGHBOURS:  # too few for a single normal: Open3D would fail
        size = ", ".join(f"{side:.3g}" for side in np.ptp(points, axis=0))
        raise ResampleFailed(
            f"the {len(points)} points extend over ({size}) mm, which is too small for a surface with "
            f"edges of {edge_mm:.3g} mm, which the size of the design asks for",
            mesh=name,
            remedy="set the unit of the file in options.units, or send a scan of more of the part",
        )
    spacing = float(np.median(np.asarray(cloud.compute_nearest_neighbor_distance())))
    cloud.estimate_normals(o3d.geometry.KDTreeSearchParamKNN(knn=NORMAL_NEIGHBOURS))
    cloud.orient_normals_consistent_tangent_plane(ORIENTATION_NEIGHBOURS)
    extent = float(np.ptp(points, axis=0).max())
    depth = int(np.clip(np.ceil(np.log2(POISSON_MARGIN * extent / spacing)), *POISSON_DEPTHS))
    poisson, _ = o3d.geometry.TriangleMesh.create_from_point_cloud_poisson(cloud, depth=depth, n_threads=1)
    mesh = Mesh(np.asarray(poisson.vertices), np.asarray(poisson.triangles))
    mesh = Mesh(mesh.vertices, mesh.faces[_near(mesh, np.asarray(cloud.points), TRIM_SPACINGS * spacing)])
    if len(mesh.faces) == 0:
        raise ResampleFailed("no surface could be reconstructed from the points", mesh=name)
    cleaned = clean(mesh, name, CleanSettings(min_component_share=MIN_POISSON_COMPONENT_SHARE)).mesh
    return Mesh(cleaned.vertices + middle, cleaned.faces)


def _near(mesh: Mesh, points: FloatArray, radius_mm: float) -> BoolArray:
    """(m,) faces all of whose corners have a point within `radius_mm`."""
    distance, _ = nearest(points, mesh.vertices)
    return np.asarray((distance <= radius_mm)[mesh.faces].all(axis=1), dtype=np.bool_)
