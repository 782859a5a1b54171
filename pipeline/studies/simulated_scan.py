"""A simulated scan of a shape, with a known pose: other triangles, measurement noise, and optionally a
missing part.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from pipeline.core.mesh import BoolArray, FloatArray, Mesh
from pipeline.core.settings import CleanSettings
from pipeline.kernels import remesh, rigid
from pipeline.stages.clean import clean
from pipeline.stages.resample import working_edge_mm

#: Vertices of the new triangulation; each scan draws its own number within VERTEX_SPREAD of it.
#: Both chosen by hand; not fitted.
SCAN_VERTICES = 8000
VERTEX_SPREAD = 0.25
#: Iterations of isotropic remeshing; chosen by hand; not fitted.
REMESH_ITERATIONS = 4
#: Share of the scan's vertices on the removed side of the plane in the cropped condition (a share of the
#: vertices, not of the area); chosen by hand; not fitted.
CROP = 0.3
#: Standard deviation of the noise over the diagonal; chosen by hand; not fitted.
LOW_NOISE_SHARE = 0.001
HIGH_NOISE_SHARE = 0.003


@dataclass(frozen=True, slots=True)
class Condition:
    """noise_share : standard deviation along the normal over the diagonal of the shape;
    crop : share of the vertices on the removed side of a plane. Triangles that cross the plane are removed
    too.
    """

    name: str
    noise_share: float
    crop: float


def conditions(noise_share: float | None) -> tuple[Condition, ...]:
    """The conditions of the study: two noise levels and a cropped scan.

    noise_share : if present, only this noise level is used, without and with a crop
    """
    if noise_share is not None:
        custom = Condition(f"noise {noise_share:.2%}", noise_share, 0.0)
        return custom, Condition(f"{custom.name}, {CROP:.0%} cut off", noise_share, CROP)
    return (
        Condition("noise 0.1%", LOW_NOISE_SHARE, 0.0),
        Condition("noise 0.3%", HIGH_NOISE_SHARE, 0.0),
        Condition(f"noise 0.1%, {CROP:.0%} cut off", LOW_NOISE_SHARE, CROP),
    )


def simulate_scan(
    mesh: Mesh, condition: Condition, rng: np.random.Generator
) -> tuple[Mesh, Callable[[FloatArray], BoolArray], FloatArray]:
    """The scan, a function that says which points (k, 3) of the shape it contains, and T_scan_design (4, 4).

    mesh : the shape, mm. The shape is rotated before it is remeshed, so no two scans share triangles. The
    noise is Gaussian along the vertex normals.
    """
    T_scan_design = _random_motion(rng, mesh.diagonal_mm)
    moved = mesh.moved(T_scan_design)
    area = float(mesh.face_areas_mm2().sum())
    factor = rng.uniform(1.0 - VERTEX_SPREAD, 1.0 + VERTEX_SPREAD)
    edge_mm = working_edge_mm(area, int(factor * SCAN_VERTICES))
    copy = remesh.isotropic(moved, edge_mm, REMESH_ITERATIONS)
    copy = clean(copy, "scan", CleanSettings()).mesh
    noise = rng.normal(0.0, condition.noise_share * mesh.diagonal_mm, len(copy.vertices))
    noisy = copy.vertices + noise[:, None] * copy.vertex_normals()
    direction = rng.normal(size=3)
    along = copy.vertices @ direction
    plane = float(np.quantile(along, condition.crop)) if condition.crop > 0 else -np.inf
    scan = clean(
        Mesh(noisy, copy.faces[(along >= plane)[copy.faces].all(axis=1)]), "scan", CleanSettings()
    ).mesh

    def contains(points: FloatArray) -> BoolArray:
        return np.asarray(rigid.transformed(T_scan_design, points) @ direction >= plane)

    return scan, contains, T_scan_design


def _random_motion(rng: np.random.Generator, size_mm: float) -> FloatArray:
    """(4, 4): a uniformly distributed rotation, and a translation uniform in [-size_mm, size_mm]^3."""
    q, r = np.linalg.qr(rng.normal(size=(3, 3)))
    q = q * np.sign(np.diag(r))
    q[:, 0] *= np.linalg.det(q)
    return rigid.compose(q, rng.uniform(-size_mm, size_mm, 3))
