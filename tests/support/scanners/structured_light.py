"""Structured light: several views merged, each slightly out of place; only what one of them sees."""

import numpy as np

from pipeline.core.mesh import FloatArray, Mesh
from pipeline.core.settings import CleanSettings
from pipeline.kernels import remesh, rigid
from pipeline.kernels.surface_patches import adjacency_of, neighbour_means
from pipeline.stages.clean import clean
from pipeline.stages.resample import working_edge_mm
from tests.support.scanners.rays import seen_from
from tests.support.scanners.record import SimulatedScan, random_direction

#: Vertices of the merged surface before what no view sees is taken away.
VERTICES = 15_000
#: Views that are merged.
VIEWS = 8
#: Of the accuracy: noise of a point, and displacement of a view.
NOISE_SHARE, VIEW_SHARE = 0.7, 0.7
#: Rounds of averaging noise over neighbours: points of a surface are not independent.
CORRELATION_ROUNDS = 1
#: Smallest cosine of incidence at which a projector's stripes are seen.
MIN_COSINE = 0.2


def structured_light(part: Mesh, accuracy_mm: float, rng: np.random.Generator) -> SimulatedScan:
    """The part from `VIEWS` random directions, merged into one surface."""
    copy = retriangulated(part, VERTICES)
    normals = copy.vertex_normals()
    weight = np.zeros(len(copy.vertices))
    shift = np.zeros_like(copy.vertices)
    for _ in range(VIEWS):
        direction = random_direction(rng)
        cosine = np.clip(normals @ direction, 0.0, 1.0)
        sees = seen_from(part, copy.vertices, normals, direction) & (cosine > MIN_COSINE)
        moved = rigid.transformed(_small_motion(copy, VIEW_SHARE * accuracy_mm, rng), copy.vertices)
        weight += np.where(sees, cosine, 0.0)
        shift += np.where(sees, cosine, 0.0)[:, None] * (moved - copy.vertices)
    seen = weight > 0
    noise = neighbour_means(
        adjacency_of(copy), rng.normal(size=len(seen)), np.ones(len(seen)), CORRELATION_ROUNDS
    )
    noise *= NOISE_SHARE * accuracy_mm / float(noise.std())
    vertices = copy.vertices + shift / np.maximum(weight, 1e-9)[:, None] + noise[:, None] * normals
    faces = copy.faces[seen[copy.faces].all(axis=1)]
    scan = clean(Mesh(vertices, faces), "scan", CleanSettings(min_component_share=0.002)).mesh
    return SimulatedScan.posed(scan, accuracy_mm, rng)


def retriangulated(part: Mesh, vertices: int) -> Mesh:
    """The same surface in even triangles."""
    edge_mm = working_edge_mm(float(part.face_areas_mm2().sum()), vertices)
    return clean(remesh.isotropic(part, edge_mm, 4), "part", CleanSettings()).mesh


def _small_motion(mesh: Mesh, rms_mm: float, rng: np.random.Generator) -> FloatArray:
    """(4, 4) that moves the vertices by `rms_mm` (RMS)."""
    vector = rng.normal(size=6)
    vector[:3] /= mesh.diagonal_mm
    centre = mesh.vertices.mean(axis=0)
    T = rigid.from_vector(vector[None] * 1e-3)[0]
    T = rigid.rotation_about(T[:3, :3], centre, centre + T[:3, 3])
    return rigid.from_vector(vector[None] * 0)[0] if rms_mm == 0 else _scaled(T, mesh, rms_mm)


def _scaled(T: FloatArray, mesh: Mesh, rms_mm: float) -> FloatArray:
    """The small motion T made as large as asked for (to first order, then orthonormal)."""
    factor = rms_mm / rigid.rms_displacement(T, np.eye(4), mesh.vertices)
    return rigid.orthonormal(np.eye(4) + factor * (T - np.eye(4)))
