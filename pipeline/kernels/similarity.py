"""Scale and deformation of a registered scan relative to its design: a diagnosis; the scan is never
scaled.
"""

from dataclasses import dataclass

import numpy as np
from scipy import stats

from pipeline.core.mesh import FloatArray
from pipeline.kernels import group_jackknife, rigid
from pipeline.kernels.icp import MIN_AGREEMENT
from pipeline.kernels.patches import patch_means, some_patches
from pipeline.kernels.surface import Surface

#: Gauss-Newton iterations on few points, at most, and then on all of them. Chosen by hand; not fitted.
ITERATIONS, FINAL_ITERATIONS = 12, 3
#: Every so many points are the few. Chosen by hand; not fitted.
COARSE_STEP = 4
#: A step that changes the factors, and moves the points relative to their radius, by less than this ends it:
#: a tenth of the last digit that a report shows of a factor. Chosen by hand; not fitted.
CONVERGENCE = 1e-5
#: Eigenvalue (dimensionless) of the normal equations below which a combination of motion and scale is free,
#: as the size of a plane is. Chosen by hand; not fitted.
MIN_EIGENVALUE = 1e-6
#: Squared share of a factor in what is free, above which the surface does not determine it. Chosen by hand:
#: what is left of it would move with the rest.
MAX_FREE_SHARE = 1e-3
#: Patches of a compact part for the standard errors: large, and small ones with edges half as long. Chosen by
#: hand.
PATCH_COUNTS = (50, 200)
#: Degrees of freedom of these standard errors over the number of large patches, so that 1.96 of them are the
#: 95 % interval of the t distribution: patches do not hold a factor equally well. Chosen by hand on six
#: shapes.
FREEDOM_SHARE = 1 / 3


@dataclass(frozen=True, slots=True)
class ScaleEstimate:
    """Size of the source over that of the target, and what scaling does not explain.

    factors : (1,) isotropic or (3,) along the target's coordinate axes; 0.996 for a print 0.4 % too small,
    nan where the surface does not determine it; standard_error : the same shape, of each factor, nan where it
    is not known;
    residual_mm : (k,) signed distance along the target's normal after scaling, 0 for excluded points;
    point : (k, 3) mm, closest points, target frame
    """

    factors: FloatArray
    standard_error: FloatArray
    residual_mm: FloatArray
    point: FloatArray


@dataclass(frozen=True, slots=True, eq=False)
class _Fitted:
    """scale, T : as applied to the source; known : (s,) whether the rows determine a factor; rows :
    (k, 6 + s) of the last step, weights : (k,), basis : (6 + s, m) what they determine; radius : mm that
    turns and scales are in units of
    """

    scale: FloatArray
    T: FloatArray
    known: FloatArray
    rows: FloatArray
    weights: FloatArray
    basis: FloatArray
    radius: float
    residual_mm: FloatArray
    point: FloatArray


def estimate_scale(
    points: FloatArray,
    weights: FloatArray,
    surface: Surface,
    T_target_source: FloatArray,
    max_distance_mm: float,
    *,
    per_axis: bool,
    normals: FloatArray | None = None,
) -> ScaleEstimate | None:
    """Point-to-plane Gauss-Newton over rotation, translation and scale, from the final pose; most of the way
    on every `COARSE_STEP`-th point. What the surface leaves free stays as it is.

    points : (k, 3) mm, source frame; weights : (k,) >= 0; surface : in the target frame; T_target_source :
    (4, 4); per_axis : three factors along the target's axes instead of one; normals : (k, 3) of the points,
    outwards, to leave out those whose closest place faces elsewhere. Correspondences beyond `max_distance_mm`
    are excluded. None if there are too few.

    Standard errors are by jackknife over patches of the surface (`kernels.group_jackknife`): neighbouring
    residuals, and the warp of the part within a patch, are not independent.
    """
    placed = rigid.transformed(T_target_source, points)
    facing = None if normals is None else rigid.rotated(T_target_source[:3, :3], normals)
    centre = np.einsum("k,kd->d", weights, placed) / weights.sum()
    scale: FloatArray = np.ones(3 if per_axis else 1)
    T: FloatArray = np.eye(4)
    fitted: _Fitted | None = None
    for step, iterations in ((COARSE_STEP, ITERATIONS), (1, FINAL_ITERATIONS)):
        some = None if facing is None else facing[::step]
        start = (centre, scale, T, iterations)
        fitted = _fit(placed[::step] - centre, some, weights[::step], surface, max_distance_mm, *start)
        if fitted is None:
            return None
        scale, T = fitted.scale, fitted.T
    assert fitted is not None  # noqa: S101 (for mypy: the loop runs)
    return ScaleEstimate(
        np.where(fitted.known, 1.0 / fitted.scale, np.nan),
        np.where(fitted.known, _standard_error(fitted), np.nan),
        np.where(fitted.weights > 0, -fitted.residual_mm, 0.0),
        fitted.point,
    )


def _fit(
    offset: FloatArray,
    facing: FloatArray | None,
    weights: FloatArray,
    surface: Surface,
    max_distance_mm: float,
    centre: FloatArray,
    scale: FloatArray,
    T: FloatArray,
    iterations: int,
) -> _Fitted | None:
    """After at most `iterations` steps. offset : (k, 3) mm, points from `centre`; facing : (k, 3) normals"""
    near = None
    fitted: _Fitted | None = None
    for _ in range(iterations):
        # the scale acts along the target's axes, about the centre; then a small rigid motion
        moved = rigid.transformed(T, centre + offset * scale)
        closest = surface.closest(moved, near)
        near = closest.face
        counted = closest.distance <= max_distance_mm
        if facing is not None:
            counted &= np.einsum("kd,kd->k", facing, closest.normal) >= MIN_AGREEMENT
        w = weights * counted
        if (w > 0).sum() < 6 + len(scale):
            return None
        # Of the place on the surface: noise along a normal must not look like size
        arm = closest.point - centre
        radius = max(float(np.sqrt((w * (arm**2).sum(axis=1)).sum() / w.sum())), 1e-300)
        along = arm * closest.normal / radius
        columns = along if len(scale) == 3 else along.sum(axis=1, keepdims=True)
        J = np.column_stack([np.cross(arm, closest.normal) / radius, closest.normal, columns])
        residual = (closest.normal * (closest.point - moved)).sum(axis=1)
        values, vectors = np.linalg.eigh(np.einsum("ki,kj->ij", w[:, None] * J, J) / w.sum())
        free = values < MIN_EIGENVALUE
        known = (vectors[6:, free] ** 2).sum(axis=1) <= MAX_FREE_SHARE
        basis, right = vectors[:, ~free], np.einsum("k,ki,k->i", w, J, residual) / w.sum()
        x = basis @ (basis.T @ right / values[~free])
        # What is free may not creep in by its small share in the rest
        scale = scale * np.where(known, 1.0 + x[6:] / radius, 1.0)
        small = rigid.from_vector(np.concatenate([x[:3] / radius, x[3:6]])[None])[0]
        T = rigid.rotation_about(small[:3, :3], centre, small[:3, 3] + centre) @ T
        fitted = _Fitted(scale, T, known, J, w, basis, radius, residual, closest.point)
        if np.abs(x).max() < CONVERGENCE * radius:
            break
    return fitted


def _standard_error(fitted: _Fitted) -> FloatArray:
    """(s,) of the factors 1 / scale.

    A residual that is correlated over a length a, across the borders of patches with edge L, loses a share
    a / L of its variance in their jackknife; two sizes tell how much, and the larger patches bound it from
    below. A scan that has too few of these has the jackknife of the small ones.
    """
    reduced = np.einsum("ki,ij->kj", fitted.rows, fitted.basis)  # not by BLAS, which splits sums
    variances, patches = [], 0
    for count in PATCH_COUNTS:
        patch = some_patches(fitted.point, count)
        found = group_jackknife.covariance(reduced, fitted.residual_mm, fitted.weights, patch)
        if found is not None:
            variances.append(np.einsum("ia,ab,ib->i", fitted.basis, found, fitted.basis)[6:])
            patches = patches or np.unique(patch[fitted.weights > 0]).size
    if not variances:
        return np.full(len(fitted.scale), np.nan)
    variance = np.maximum(variances[0], 2.0 * variances[0] - variances[-1])
    few = stats.t.ppf(0.975, FREEDOM_SHARE * patches) / stats.norm.ppf(0.975)
    return np.asarray(few * np.sqrt(variance) / fitted.radius / fitted.scale)


def residual_deformation_mm(estimate: ScaleEstimate, weights: FloatArray) -> float:
    """RMS in mm of the patch means of the signed distance after scaling: bending and warping, without
    roughness.

    weights : (k,) >= 0 of the points of `estimate`. Means over about 100 patches remove noise and keep
    long waves.
    """
    share, mean = patch_means(estimate.point, estimate.residual_mm, weights)
    return float(np.sqrt(share @ mean**2 / share.sum()))
