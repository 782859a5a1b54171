"""How well the alignment is known, and what that does to a deviation somewhere on the part.

A small motion of the scan about a point changes the deviation at a place by the motion of the place along its
normal. The covariance of the motion comes from the noise of the scan: of a fit to the surface by a jackknife
over patches, of a fit to points by the standard error of each. The part's own shape is not an error of the
alignment: it is there in every scan of the part. A scanner's distortion looks like shape, and is not in it.
"""

from dataclasses import dataclass

import numpy as np

from pipeline.core.mesh import FloatArray, Mesh
from pipeline.inspection.patches import CLIPPED_SIGMAS, DEFAULT_SHARE, DEFAULT_VERTICES, SIGMA_PER_MAD
from pipeline.kernels import group_jackknife
from pipeline.kernels.constrained_fit import AllowedMotions
from pipeline.kernels.correlated_noise import noise_of

#: Edges of the patches of the jackknife over the diameter of the default patch of the inspection; the small
#: ones show how much is lost at the borders of the large ones. Chosen by hand on three shapes: with edges
#: twice as long the curvature of a warp counts as noise, and errors are two to three times too large.
EDGE_DIAMETERS = (1.0, 0.5)
#: Eigenvalue (dimensionless) of the normal equations below which a motion is free: it stays as it is, and
#: moves no deviation. Chosen by hand; not fitted.
MIN_EIGENVALUE = 1e-6


@dataclass(frozen=True, slots=True, eq=False)
class PoseError:
    """covariance : (6, 6) of a small motion of the scan, rotation vector (radians) and translation (mm),
    about `centre` (3,), mm, in the design's frame
    """

    covariance: FloatArray
    centre: FloatArray

    def rows(self, places: FloatArray, normals: FloatArray) -> FloatArray:
        """(k, 6) change of the deviation at `places` (k, 3) along `normals` (k, 3) for a unit of motion."""
        return np.concatenate([np.cross(places - self.centre, normals), normals], axis=1)

    def of_rows(self, rows: FloatArray) -> FloatArray:
        """(k,) standard error, mm, of sums of deviations that change by `rows` (k, 6)."""
        variance = np.einsum("ki,ij,kj->k", rows, self.covariance, rows)
        return np.asarray(np.sqrt(np.maximum(variance, 0.0)))

    def at(self, places: FloatArray, normals: FloatArray) -> FloatArray:
        """(k,) standard error, mm, of the deviation at `places` (k, 3) along `normals` (k, 3)."""
        return self.of_rows(self.rows(places, normals))

    def principal_motions(self) -> FloatArray:
        """(6, 6) in rows: independent motions, each as large as its standard error."""
        values, vectors = np.linalg.eigh(self.covariance)
        return np.asarray((vectors * np.sqrt(np.maximum(values, 0.0))).T)


def patch_edge_mm(scan: Mesh, design_diagonal_mm: float) -> float:
    """Of the patches of the jackknife: the diameter of the default patches of the inspection."""
    holds_mm = 0.0
    if not scan.is_cloud:
        a_vertex_mm2 = float(scan.face_areas_mm2().sum()) / len(scan.vertices)
        holds_mm = 2.0 * float(np.sqrt(DEFAULT_VERTICES * a_vertex_mm2 / np.pi))
    return max(DEFAULT_SHARE * design_diagonal_mm, holds_mm)


def of_surface_fit(
    places: FloatArray,
    normals: FloatArray,
    residual: FloatArray,
    weights: FloatArray,
    edge_mm: float,
    allowed: AllowedMotions | None = None,
) -> PoseError | None:
    """Of a least-squares fit along the normals; None where too few patches can tell.

    places, normals : (k, 3) of the design; residual : (k,) mm under the fit; weights : (k,) >= 0; edge_mm :
    of patches within which residuals may be correlated; allowed : motions that were not held, None for all
    """
    kept = weights > 0
    if not kept.any():
        return None
    places, normals, residual, w = places[kept], normals[kept], residual[kept], weights[kept] / weights.sum()
    centre = np.einsum("k,kd->d", w, places) if allowed is None else allowed.centre
    arm = places - centre
    radius = max(float(np.sqrt((w * (arm**2).sum(axis=1)).sum())), 1e-300)
    rows = np.concatenate([np.cross(arm, normals) / radius, normals], axis=1)
    units = np.concatenate([np.full(3, 1 / radius), np.ones(3)])
    basis: FloatArray = np.eye(6)
    if allowed is not None and allowed.basis is not None:
        basis = np.linalg.qr(allowed.basis / units[:, None])[0]
    reduced = np.einsum("ki,ij->kj", rows, basis)  # not by BLAS, which splits sums among threads
    values, vectors = np.linalg.eigh(np.einsum("k,ki,kj->ij", w, reduced, reduced))
    basis = basis @ vectors[:, values >= MIN_EIGENVALUE]
    reduced = np.einsum("ki,ij->kj", rows, basis)
    found = []
    for share in EDGE_DIAMETERS:
        noise = noise_of(places, normals, residual, share * edge_mm)
        most = CLIPPED_SIGMAS * SIGMA_PER_MAD * float(np.median(np.abs(noise.values)))
        clipped = np.clip(noise.values, -most, most)  # the edge of a dent is shape, not noise
        covariance = group_jackknife.covariance(reduced, clipped, w, noise.cell)
        if covariance is None:
            return None
        found.append(noise.lost * covariance)
    large, small = found
    lost_at_borders = max(1.0, 2.0 - float(np.trace(small) / max(np.trace(large), 1e-300)))
    whole = lost_at_borders * units[:, None] * (basis @ large @ basis.T) * units
    return PoseError(whole, centre)


def of_point_fit(places: FloatArray, directions: FloatArray, errors_mm: FloatArray) -> PoseError | None:
    """Of a fit of places along directions (reference points) whose offsets have standard errors; closed form.

    places, directions : (k, 3), k >= 6; errors_mm : (k,); None where they leave a motion free
    """
    centre = places.mean(axis=0)
    arm = places - centre
    radius = max(float(np.sqrt((arm**2).sum(axis=1).mean())), 1e-300)
    rows = np.concatenate([np.cross(arm, directions) / radius, directions], axis=1)
    if np.linalg.eigvalsh(np.einsum("ki,kj->ij", rows, rows))[0] < MIN_EIGENVALUE * len(rows):
        return None
    lever = np.linalg.pinv(rows)  # (6, k): how each offset moves the part
    units = np.concatenate([np.full(3, 1 / radius), np.ones(3)])
    return PoseError(units[:, None] * (lever * errors_mm**2 @ lever.T) * units, centre)
