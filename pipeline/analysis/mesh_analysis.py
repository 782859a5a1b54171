"""What one mesh is, before anything is compared: the stages from load to landmarks, for design and scan alike."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from pipeline.api import MeshFile
from pipeline.core.mesh import FloatArray, IndexArray, Mesh
from pipeline.core.progress import Stage
from pipeline.core.results import Centre, Landmark, Note, Segments
from pipeline.core.settings import Settings
from pipeline.core.timing import StageTimer
from pipeline.kernels.nearest import nearest
from pipeline.report import decision_graph, palette
from pipeline.report import writers as report
from pipeline.report.glb import DisplayMesh
from pipeline.stages.clean import Cleaned, clean
from pipeline.stages.features import features, features_edge_mm, features_radius_mm
from pipeline.stages.geodesics import Geodesics, geodesics
from pipeline.stages.landmarks import LandmarkSet, landmarks
from pipeline.stages.load import Loaded, load
from pipeline.stages.resample import Resampled, resample, working_edge_mm
from pipeline.stages.segmentation import Segmentation, segment


@dataclass(frozen=True, slots=True)
class Scales:
    """The lengths at which both meshes of a job are looked at, taken from the design once.

    edge_mm : of the working mesh; fine_edge_mm : of the mesh that features are computed on; radius_mm : of the features;
    size_mm : sqrt(area)
    """

    edge_mm: float
    fine_edge_mm: float
    radius_mm: float
    size_mm: float

    @classmethod
    def of(cls, design: Mesh, settings: Settings) -> "Scales":
        area = float(design.face_areas_mm2().sum())
        return cls(
            working_edge_mm(area, settings.resample.target_vertices),
            features_edge_mm(area, settings.features),
            features_radius_mm(area, settings.features),
            float(np.sqrt(area)),
        )

    def matching_mm(self, settings: Settings) -> float:
        """What descriptors, tolerances and shortest pairs of matching are multiples of."""
        return settings.matching.length_share * self.size_mm


@dataclass(frozen=True, slots=True)
class Cut:
    """One mesh in segments: its working mesh, the distances on that, the segments by them."""

    resampled: Resampled
    distances: Geodesics
    segmentation: Segmentation


@dataclass(frozen=True, slots=True)
class Analysis:
    """One mesh, analysed.

    mesh : the cleaned mesh, which `vertex` in results indexes; landmark_vertices : (k,) its vertex nearest to each
    landmark; resampled.mesh : the working mesh, on which segmentation and landmarks live
    """

    mesh: Mesh
    resampled: Resampled
    segmentation: Segmentation
    landmarks: LandmarkSet
    landmark_vertices: IndexArray
    warnings: tuple[Note, ...]

    def shown(self) -> DisplayMesh:
        """`mesh` for viewers."""
        return DisplayMesh(self.mesh, self.resampled.light)

    def segment_colours(self) -> FloatArray:
        """(n, 3) of the vertices of `mesh`."""
        return palette.of_vertices(self.segmentation.labels, self.segmentation.halo)[
            self.resampled.working_of_clean
        ]


def read(
    file: MeshFile, name: str, settings: Settings, watch: StageTimer, *, needs_surface: bool
) -> tuple[Loaded, Cleaned]:
    with watch.stage(Stage.LOAD, name):
        loaded = load(file, name, settings.load, needs_surface=needs_surface)
    with watch.stage(Stage.CLEAN, name):
        return loaded, clean(loaded.mesh, name, settings.clean)


def cut(
    mesh: Mesh, name: str, scales: Scales, settings: Settings, watch: StageTimer, seed: int, *, fine: bool = False
) -> Cut:
    """Section 1 of the method, steps 1 and 2. fine : also make the mesh for features."""
    with watch.stage(Stage.RESAMPLE, name):
        fine_edge_mm = scales.fine_edge_mm if fine else None
        resampled = resample(mesh, name, scales.edge_mm, settings.resample, fine_edge_mm=fine_edge_mm)
    working = resampled.mesh
    with watch.stage(Stage.GEODESICS, name):
        distances = geodesics(working, name, scales.size_mm, settings.geodesics, settings.segmentation)
    with watch.stage(Stage.SEGMENTATION, name):
        return Cut(resampled, distances, segment(working, name, distances, settings.segmentation, seed))


def analyse(mesh: Mesh, name: str, scales: Scales, settings: Settings, watch: StageTimer, seed: int) -> Analysis:
    """Section 1 of the method, steps 1 to 4."""
    found = cut(mesh, name, scales, settings, watch, seed, fine=True)
    working, distances, segmentation = found.resampled.mesh, found.distances, found.segmentation
    with watch.stage(Stage.FEATURES, name):
        measured = features(found.resampled.fine or working, scales.radius_mm, settings.features)
    with watch.stage(Stage.LANDMARKS, name):
        marked = landmarks(working, distances.surface, segmentation, measured, settings.landmarks, seed)
    _, vertices = nearest(mesh.vertices, marked.position_mm)
    return Analysis(mesh, found.resampled, segmentation, marked, vertices, distances.warnings)


def landmark_records(analysis: Analysis) -> list[Landmark]:
    found = analysis.landmarks
    return [
        Landmark(
            id=number,
            vertex=int(analysis.landmark_vertices[number]),
            position_mm=found.position_mm[number].tolist(),
            normal=found.normal[number].tolist(),
            segment=int(found.segment[number]),
            t2=float(found.t2[number]),
            strength=float(found.strength[number]),
        )
        for number in range(len(found.vertex))
    ]


def segments_record(analysis: Analysis, settings: Settings) -> Segments:
    return cut_record(
        analysis.mesh,
        analysis.resampled,
        analysis.segmentation,
        settings,
        limit_share=analysis.landmarks.limit_share,
    )


def cut_record(
    mesh: Mesh,
    resampled: Resampled,
    segmentation: Segmentation,
    settings: Settings,
    *,
    limit_share: float | None,
) -> Segments:
    """Centres are given as the nearest vertex of `mesh`, the cleaned one; `size` counts its vertices."""
    positions = resampled.mesh.vertices[segmentation.centres]
    _, vertices = nearest(mesh.vertices, positions)
    sizes = np.bincount(segmentation.labels[resampled.working_of_clean], minlength=len(segmentation.centres))
    return Segments(
        count=len(segmentation.centres),
        method=settings.segmentation.method,
        metric=settings.geodesics.metric,
        density=settings.segmentation.density,
        d_c=segmentation.d_c_mm,
        halo_fraction=float(segmentation.halo.mean()),
        limit_share=limit_share,
        centres=[
            Centre(
                segment=number,
                vertex=int(vertices[number]),
                position_mm=positions[number].tolist(),
                rho=float(segmentation.rho[centre]),
                delta=float(segmentation.delta[centre]),
                size=int(sizes[number]),
            )
            for number, centre in enumerate(segmentation.centres)
        ],
    )


def write_analysis(out: Path, name: str, analysis: Analysis, settings: Settings) -> list[str]:
    """`<name>.clean.ply`, `.vertices.csv` and `.decision_graph.svg`; returns their names."""
    report.write_mesh(out / f"{name}.clean.ply", analysis.mesh)
    report.write_vertices(
        *(out / f"{name}.vertices.csv", analysis.mesh, analysis.resampled.working_of_clean),
        *(analysis.segmentation, analysis.landmarks.t2_all, analysis.landmark_vertices),
    )
    decision_graph.write(
        out / f"{name}.decision_graph.svg", name, analysis.segmentation, settings.segmentation
    )
    return [f"{name}.clean.ply", f"{name}.vertices.csv", f"{name}.decision_graph.svg"]
