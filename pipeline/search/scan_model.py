"""The scan as the pose search uses it: a few points, many points, the views it was taken from, what it
covers.
"""

from dataclasses import dataclass

import numpy as np

from pipeline.core.mesh import FloatArray, IndexArray, Mesh
from pipeline.core.settings import RegistrationSettings
from pipeline.core.stations import Stations
from pipeline.kernels import rigid, sampling
from pipeline.kernels.nearest import nearest
from pipeline.kernels.surface import Surface
from pipeline.kernels.visibility import LinesOfSight, ViewModel
from pipeline.search.schedule import REGISTRATION
from pipeline.search.types import MIRROR, PoseCost, mirror_mesh


@dataclass(frozen=True, slots=True)
class ScanPoints:
    """points : (k, 3) mm, each for the same share of the scan; normals : (k, 3), None for a point cloud;
    weights : (k,), sum 1; vertices : (k,) of the cloud that the points are, None for a surface
    """

    points: FloatArray
    normals: FloatArray | None
    weights: FloatArray
    vertices: IndexArray | None = None

    @classmethod
    def of(cls, scan: Mesh, count: int, seed: int) -> "ScanPoints":
        """`count` points of the surface, or so many of a cloud's points at random."""
        if scan.is_cloud:
            chosen = np.sort(np.random.default_rng(seed).permutation(len(scan.vertices))[:count])
            return cls(scan.vertices[chosen], None, np.full(len(chosen), 1.0 / len(chosen)), chosen)
        samples = sampling.on_surface(scan, count, seed)
        return cls(samples.points, samples.normals, np.full(count, 1.0 / count))

    def evaluate(self, T_design_scan: FloatArray, design: Surface, inlier_distance_mm: float) -> PoseCost:
        """The cost of a pose on the exact design surface."""
        distance = design.closest(rigid.transformed(T_design_scan, self.points)).distance
        # numpy's own sums: a dot product of many points is split among threads
        cost_mm2 = float((self.weights * np.minimum(distance, inlier_distance_mm) ** 2).sum())
        return PoseCost(cost_mm2, float(np.sqrt((self.weights * distance**2).sum())))


class ScanModel:
    """Samples and surface of one scan. fine_samples, coarse_samples : for the final ICP and for trials;
    surface : in the scan's own frame, None for a point cloud
    """

    def __init__(
        self,
        mesh: Mesh,
        surface: Surface | None,
        settings: RegistrationSettings,
        seed: int,
        stations: Stations | None = None,
    ) -> None:
        self.mesh, self.surface, self._stations = mesh, surface, stations
        self.fine_samples = ScanPoints.of(mesh, settings.sample_points, seed)
        self.coarse_samples = ScanPoints.of(mesh, REGISTRATION.coarse_samples, seed)
        self._seed = seed
        self._to_surface: FloatArray = np.ones(3)

    @classmethod
    def of(
        cls, mesh: Mesh, settings: RegistrationSettings, seed: int, stations: Stations | None = None
    ) -> "ScanModel":
        """The model of a scan. stations : where its scanner stood, where that is known"""
        return cls(mesh, None if mesh.is_cloud else Surface(mesh), settings, seed, stations)

    @classmethod
    def mirrored(
        cls,
        mesh: Mesh,
        surface: Surface | None,
        settings: RegistrationSettings,
        seed: int,
        stations: Stations | None = None,
    ) -> "ScanModel":
        """The model of a scan's mirror image (`mirror_mesh`). mesh, surface, stations : of the scan itself"""
        if stations is not None:
            stations = Stations(stations.positions_mm * MIRROR, stations.of_vertex)
        model = cls(mirror_mesh(mesh), surface, settings, seed, stations)
        model._to_surface = MIRROR
        return model

    @property
    def lines_of_sight(self) -> LinesOfSight | None:
        """Of some points of a cloud, whose file says where the scanner stood; else None."""
        samples = self.coarse_samples
        if self._stations is None or samples.vertices is None:
            return None
        station = self._stations.of_vertex[samples.vertices]
        known = np.flatnonzero(station >= 0)
        some = known[:: max(1, len(known) // REGISTRATION.occlusion_samples)]
        if not some.size:
            return None
        return LinesOfSight(samples.points[some], self._stations.positions_mm[station[some]])

    def views(self, normal_sign: float) -> ViewModel | None:
        """The directions it may have been seen from; None for a cloud, which has no outer side."""
        samples = self.coarse_samples
        if samples.normals is None:
            return None
        some = slice(None, None, max(1, len(samples.points) // REGISTRATION.occlusion_samples))
        return ViewModel.of(samples.points[some], normal_sign * samples.normals[some])

    def coverage(
        self, T_design_scan: FloatArray, normal_sign: float, design: Surface, inlier_distance_mm: float
    ) -> float:
        """Area share of the design within the inlier distance of the scan and with agreeing normals: the scan
        of one side of a thin wall does not cover the other side.
        """
        samples = sampling.on_surface(design.mesh, REGISTRATION.coverage_samples, self._seed)
        T_scan_design = rigid.inverse(T_design_scan)
        in_scan = rigid.transformed(T_scan_design, samples.points)
        if self.surface is None:
            distance, _ = nearest(self.mesh.vertices, in_scan)
            return float(np.mean(distance <= inlier_distance_mm))
        # A mirror image is looked up in the surface of the scan itself: queries are reflected.
        closest = self.surface.closest(in_scan * self._to_surface)
        normals_scan = samples.normals @ T_scan_design[:3, :3].T * self._to_surface
        agrees = normal_sign * np.einsum("kd,kd->k", normals_scan, closest.normal) > 0
        return float(np.mean((closest.distance <= inlier_distance_mm) & agrees))
