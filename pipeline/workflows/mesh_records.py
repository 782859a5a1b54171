"""From the analysis of one mesh to the records of the results: segments, landmarks, warnings."""

import numpy as np

from pipeline.analysis.brep_segments import segment_of_brep
from pipeline.analysis.mesh_analysis import Analysis
from pipeline.core.brep_faces import BrepFaces
from pipeline.core.mesh import Mesh
from pipeline.core.results import Centre, Landmark, Note, Segments
from pipeline.core.settings import Settings
from pipeline.kernels.nearest import nearest
from pipeline.stages.resample import Resampled
from pipeline.stages.segmentation import Segmentation


def landmark_records(analysis: Analysis) -> list[Landmark]:
    """The landmarks, strongest first, in the mesh's own frame."""
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


def landmark_warnings(**landmarks: list[Landmark]) -> list[Note]:
    """One for each named mesh without landmarks."""
    detail = "no landmarks: the surface has no relief at the scale of the features (features.radius_mm)"
    return [
        Note(code="no_landmarks", detail=f"{name}: {detail}")
        for name, found in landmarks.items()
        if not found
    ]


def analysis_segments(analysis: Analysis, settings: Settings, brep: BrepFaces | None = None) -> Segments:
    """The segments of an analysed mesh. brep : faces of its CAD model, where its file has them"""
    limit_share = analysis.landmarks.limit_share
    record = segments_record(
        analysis.mesh, analysis.resampled, analysis.segmentation, settings, limit_share=limit_share
    )
    if brep is None:
        return record
    segment = segment_of_brep(analysis.mesh, brep, analysis.segment_of_faces())
    centres = [
        centre.model_copy(update={"brep_faces": np.flatnonzero(segment == centre.segment).tolist()})
        for centre in record.centres
    ]
    return record.model_copy(update={"centres": centres})


def segments_record(
    mesh: Mesh,
    resampled: Resampled,
    segmentation: Segmentation,
    settings: Settings,
    *,
    limit_share: float | None,
) -> Segments:
    """Centres are given as the nearest vertex of `mesh`, the cleaned one; `size` counts its vertices.

    limit_share : share of vertices beyond the T^2 limit, None where no landmarks were computed
    """
    positions = resampled.mesh.vertices[segmentation.centres]
    _, vertices = nearest(mesh.vertices, positions)
    labels = segmentation.labels[resampled.working_of_clean]
    sizes = np.bincount(labels, minlength=len(segmentation.centres))
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
