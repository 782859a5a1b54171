"""The analysis of one mesh, the same for design and scan: working mesh, geodesics, segments, features,
landmarks.
"""

from dataclasses import dataclass, replace

import numpy as np

from pipeline.core.landmark_set import LandmarkSet
from pipeline.core.mesh import IndexArray, IntArray, Mesh
from pipeline.core.progress import Stage
from pipeline.core.results import Note
from pipeline.core.settings import Settings
from pipeline.core.stations import Stations
from pipeline.core.timing import StageTimer
from pipeline.kernels.nearest import nearest
from pipeline.search.types import DescribedMesh
from pipeline.stages.features import features, features_edge_mm, features_radius_mm
from pipeline.stages.geodesics import Geodesics, geodesics
from pipeline.stages.landmarks import landmarks
from pipeline.stages.resample import Resampled, resample, working_edge_mm
from pipeline.stages.segmentation import Segmentation, segment


@dataclass(frozen=True, slots=True)
class Scales:
    """The lengths at which both meshes of a job are analysed, taken from the design once.

    edge_mm : edge length of the working mesh; fine_edge_mm : of the mesh that features are computed on;
    radius_mm : averaging radius of the features; size_mm : square root of the design's area
    """

    edge_mm: float
    fine_edge_mm: float
    radius_mm: float
    size_mm: float

    @classmethod
    def of(cls, design: Mesh, settings: Settings) -> "Scales":
        """The scales of a cleaned design."""
        area = float(design.face_areas_mm2().sum())
        return cls(
            working_edge_mm(area, settings.resample.target_vertices),
            features_edge_mm(area, settings.features),
            features_radius_mm(area, settings.features),
            float(np.sqrt(area)),
        )

    def matching_mm(self, settings: Settings) -> float:
        """The unit of length of matching: descriptors, tolerances and shortest pairs are multiples of it."""
        return settings.matching.length_share * self.size_mm


@dataclass(frozen=True, slots=True)
class SegmentationResult:
    """The segments of one mesh, with the working mesh and the distances that they come from."""

    resampled: Resampled
    distances: Geodesics
    segmentation: Segmentation


@dataclass(frozen=True, slots=True)
class Analysis:
    """One analysed mesh.

    mesh : the cleaned mesh, which `vertex` in results indexes; landmark_vertices : (k,) its vertex nearest to
    each landmark; resampled.mesh : the working mesh, on which segmentation and landmarks live; stations :
    where the scanner of `mesh` stood, None where its file does not say
    """

    mesh: Mesh
    resampled: Resampled
    segmentation: Segmentation
    landmarks: LandmarkSet
    landmark_vertices: IndexArray
    warnings: tuple[Note, ...]
    stations: Stations | None = None

    def segment_of_faces(self) -> IntArray:
        """(m,) segment of each face of `mesh`: that of its first vertex."""
        return self.segmentation.labels[self.resampled.working_of_clean[self.mesh.faces[:, 0]]]

    def without_fine_mesh(self) -> "Analysis":
        """The same without the mesh of the features, which no later stage needs."""
        return replace(self, resampled=replace(self.resampled, fine=None))


def segment_mesh(
    mesh: Mesh,
    name: str,
    scales: Scales,
    settings: Settings,
    timer: StageTimer,
    seed: int,
    *,
    fine: bool = False,
) -> SegmentationResult:
    """Stages resample, geodesics and segmentation (steps 1 and 2 of the method). fine : also make the finer
    mesh that features are computed on
    """
    with timer.stage(Stage.RESAMPLE, name):
        fine_edge_mm = scales.fine_edge_mm if fine else None
        resampled = resample(mesh, name, scales.edge_mm, settings.resample, fine_edge_mm=fine_edge_mm)
    working = resampled.mesh
    with timer.stage(Stage.GEODESICS, name):
        distances = geodesics(working, name, scales.size_mm, settings.geodesics, settings.segmentation)
    with timer.stage(Stage.SEGMENTATION, name):
        segmentation = segment(working, name, distances, settings.segmentation, seed)
    return SegmentationResult(resampled, distances, segmentation)


def analyse_mesh(
    mesh: Mesh,
    name: str,
    scales: Scales,
    settings: Settings,
    timer: StageTimer,
    seed: int,
    *,
    stations: Stations | None = None,
) -> Analysis:
    """Stages resample to landmarks (steps 1 to 4 of the method) of a cleaned mesh. stations : of it"""
    segments = segment_mesh(mesh, name, scales, settings, timer, seed, fine=True)
    working, distances, segmentation = segments.resampled.mesh, segments.distances, segments.segmentation
    with timer.stage(Stage.FEATURES, name):
        features_of_mesh = features(segments.resampled.fine or working, scales.radius_mm, settings.features)
    with timer.stage(Stage.LANDMARKS, name):
        landmark_set = landmarks(
            working, distances.surface, segmentation, features_of_mesh, settings.landmarks, seed
        )
    _, vertices = nearest(mesh.vertices, landmark_set.position_mm)
    return Analysis(
        mesh, segments.resampled, segmentation, landmark_set, vertices, distances.warnings, stations
    )


def describe_mesh(analysis: Analysis, scales: Scales, settings: Settings) -> DescribedMesh:
    """The mesh as matching uses it, its descriptors computed."""
    radius_mm = settings.matching.descriptor_radius_lengths * scales.matching_mm(settings)
    return DescribedMesh.of(analysis.resampled.mesh, analysis.landmarks, radius_mm)
