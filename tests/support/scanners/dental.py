"""A dental scanner: seen from above only, holes in undercuts, stitching drift along the arch."""

import numpy as np
from scipy.spatial.transform import Rotation

from pipeline.core.mesh import FloatArray, Mesh
from pipeline.core.settings import CleanSettings
from pipeline.stages.clean import clean
from tests.support.scanners.rays import seen_from
from tests.support.scanners.record import SimulatedScan
from tests.support.scanners.structured_light import retriangulated

#: Vertices of the scan, before holes.
VERTICES = 15_000
#: The wand tilts by so much, degrees, to each of so many sides.
TILT_DEG, SIDES = 40.0, 6
#: Of the accuracy: scatter of a point, and drift (RMS).
NOISE_SHARE, DRIFT_SHARE = 0.4, 0.9165


def dental_scanner(part: Mesh, accuracy_mm: float, rng: np.random.Generator) -> SimulatedScan:
    """The part from the side that most of its surface faces."""
    copy = retriangulated(part, VERTICES)
    normals = copy.vertex_normals()
    up = _facing(part)
    side = np.cross(up, np.eye(3)[int(np.abs(up).argmin())])
    side /= np.linalg.norm(side)
    tilted = Rotation.from_rotvec(np.radians(TILT_DEG) * side).apply(up)
    turns = 2 * np.pi * np.arange(SIDES) / SIDES
    views = [up, *(Rotation.from_rotvec(turn * up).apply(tilted) for turn in turns)]
    seen = np.any([seen_from(part, copy.vertices, normals, view) for view in views], axis=0)
    noise = rng.normal(0.0, NOISE_SHARE * accuracy_mm, len(seen))
    vertices = copy.vertices + noise[:, None] * normals + _drift(copy, up, DRIFT_SHARE * accuracy_mm, rng)
    faces = copy.faces[seen[copy.faces].all(axis=1)]
    scan = clean(Mesh(vertices, faces), "scan", CleanSettings(min_component_share=0.002)).mesh
    return SimulatedScan.posed(scan, accuracy_mm, rng)


def _facing(part: Mesh) -> FloatArray:
    """(3,) the mean normal of an open part; of a closed one the axis of least extent."""
    mean = part.face_cross_mm2().sum(axis=0)
    if np.linalg.norm(mean) > 0.1 * part.face_areas_mm2().sum():
        return np.asarray(mean / np.linalg.norm(mean))
    centred = part.vertices - part.vertices.mean(axis=0)
    return np.asarray(np.linalg.eigh(np.einsum("ni,nj->ij", centred, centred))[1][:, 0])


def _drift(mesh: Mesh, up: FloatArray, rms_mm: float, rng: np.random.Generator) -> FloatArray:
    """(n, 3) a bend and a twist that grow with the square of the way along the longest axis."""
    centred = mesh.vertices - mesh.vertices.mean(axis=0)
    along = np.linalg.eigh(np.einsum("ni,nj->ij", centred, centred))[1][:, 2]
    t = centred @ along
    t = (t - t.min()) / max(float(np.ptp(t)), 1e-300)
    across = np.cross(along, up)
    moved = (t**2)[:, None] * (rng.normal() * up + rng.normal() * across)
    moved += (t**2 * (centred @ across) / mesh.diagonal_mm)[:, None] * rng.normal() * up
    rms = float(np.sqrt((moved**2).sum(axis=1).mean()))
    return np.asarray(moved * rms_mm / max(rms, 1e-300))
