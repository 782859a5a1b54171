"""Deviation over patches of the surface: a median over all scan vertices near a place decides, so that a
single noisy vertex does not.
"""

from dataclasses import dataclass

import numpy as np
from scipy import stats
from scipy.spatial import cKDTree

from pipeline.core.mesh import BoolArray, FloatArray, IndexArray
from pipeline.inspection.measured_surface import MeasuredSurface

#: Scan vertices of a patch, at least, for its median to be a value. Chosen by hand.
MIN_VERTICES = 6
#: Scan vertices that a patch of the default size holds, at least. Chosen by hand: their median has a third of
#: the noise of one.
DEFAULT_VERTICES = 12
#: Diameter of the default patch over the design's diagonal. Chosen by hand: the edges of the working mesh.
DEFAULT_SHARE = 0.02
#: Scan vertices in all patches together, about, at most; of a denser scan every k-th is taken. Limits time
#: and memory; of a scan of a million triangles some 250 a patch are left.
MAX_MEMBERS = 1_000_000
#: Degrees of freedom of the scatter of n values over n - 1: what clipping costs. Chosen by hand.
FREEDOM_SHARE = 0.9
#: Deviations from the median beyond so many standard deviations count as so many. Chosen by hand.
CLIPPED_SIGMAS = 3.0
#: Standard deviations in a median absolute deviation (of the normal distribution).
SIGMA_PER_MAD = 1.4826
#: Standard error of a median of n values over sigma / sqrt(n), for the normal distribution (derived).
MEDIAN_ERROR = float(np.sqrt(np.pi / 2))


@dataclass(frozen=True, slots=True, eq=False)
class Patches:
    """One patch about each of the c places of `MeasuredSurface`, in its order.

    diameter_mm; value_mm : (c,) median deviation, nan where the scan shows too little; error_mm : (c,)
    standard error of it, nan where the value is from the design's side; n : (c,) scan vertices of the patch
    """

    diameter_mm: float
    value_mm: FloatArray
    error_mm: FloatArray
    n: IndexArray


@dataclass(frozen=True, slots=True)
class Value:
    """A median of n deviations. error_mm : its standard error, None where n is 1"""

    median_mm: float
    error_mm: float | None
    n: int


def default_diameter_mm(surface: MeasuredSurface, design_diagonal_mm: float) -> float:
    """Of a patch: a share of the design's size, or what holds `DEFAULT_VERTICES` of a coarse scan."""
    holds_mm = 2.0 * float(np.sqrt(DEFAULT_VERTICES * surface.vertex_area_mm2 / np.pi))
    return max(DEFAULT_SHARE * design_diagonal_mm, holds_mm)


def patches(surface: MeasuredSurface, diameter_mm: float, inflation: float = 1.0) -> Patches:
    """The median deviation about each place of the design. inflation : as in `median_of`

    A patch holds the scan vertices whose closest place on the design is within half of `diameter_mm`, on the
    same side of a thin wall. Where it holds too few, but the scan's surface is near (a piece that broke off),
    the median is of the design's places in the patch, of their distances to the scan.
    """
    count = len(surface.place_mm)
    stride = _stride(surface, diameter_mm)
    vertex = np.arange(0, len(surface.foot_mm), stride)
    place, near = _near(
        surface.place_mm, surface.place_normal, surface.foot_mm[vertex], surface.normal[vertex], diameter_mm
    )
    value_mm, error_mm, n = _medians(place, surface.signed_mm[vertex[near]], count, inflation)
    few = n < MIN_VERTICES
    seen = np.flatnonzero(np.isfinite(surface.signed_at_place_mm))
    place, near = _near(
        surface.place_mm,
        surface.place_normal,
        surface.place_mm[seen],
        surface.place_normal[seen],
        diameter_mm,
    )
    from_design_mm, _, places = _medians(place, surface.signed_at_place_mm[seen[near]], count)
    value_mm = np.where(few, np.where(places > 0, from_design_mm, np.nan), value_mm)
    return Patches(diameter_mm, value_mm, np.where(few, np.nan, error_mm), n)


def median_of(signed_mm: FloatArray, inflation: float = 1.0) -> Value:
    """signed_mm : (n,), n > 0; inflation : variance of a mean of neighbours over that of independent values,
    `correlated_noise.Noise.inflation`
    """
    value_mm, error_mm, n = _medians(np.zeros(len(signed_mm), dtype=np.int64), signed_mm, 1, inflation)
    return Value(float(value_mm[0]), float(error_mm[0]) if len(signed_mm) > 1 else None, int(n[0]))


def _stride(surface: MeasuredSurface, diameter_mm: float) -> int:
    a_patch_mm2 = np.pi * diameter_mm**2 / 4
    members = len(surface.place_mm) * a_patch_mm2 / max(surface.vertex_area_mm2, 1e-300)
    return max(1, int(np.ceil(members / MAX_MEMBERS)))


def _near(
    centres: FloatArray,
    normals: FloatArray,
    points: FloatArray,
    point_normals: FloatArray,
    diameter_mm: float,
) -> tuple[IndexArray, IndexArray]:
    """Pairs (centre, point) not farther apart than half the diameter, with normals to the same side."""
    pairs = cKDTree(centres).sparse_distance_matrix(cKDTree(points), diameter_mm / 2, output_type="ndarray")
    place, near = pairs["i"].astype(np.int64), pairs["j"].astype(np.int64)
    same_side: BoolArray = np.einsum("kd,kd->k", normals[place], point_normals[near]) > 0
    return place[same_side], near[same_side]


def _medians(
    group: IndexArray, values: FloatArray, count: int, inflation: float = 1.0
) -> tuple[FloatArray, FloatArray, IndexArray]:
    """(count,) median of each group, its standard error, and its number of values; nan without any.

    group : (k,) in [0, count); values : (k,). The scatter is the standard deviation about the median, of
    deviations clipped at `CLIPPED_SIGMAS`. Of few values it is not well known: 1.96 standard errors are the
    95 % interval of the t distribution.
    """
    n = np.bincount(group, minlength=count)
    median = _median_by(group, values, n)
    away = np.abs(values - median[group])
    clipped = np.minimum(away, CLIPPED_SIGMAS * SIGMA_PER_MAD * _median_by(group, away, n)[group])
    several = np.maximum(n - 1, 1)
    scatter = np.sqrt(np.bincount(group, weights=clipped**2, minlength=count) / several)
    sizes, of_size = np.unique(several, return_inverse=True)
    few = np.asarray(stats.t.ppf(0.975, FREEDOM_SHARE * sizes) / stats.norm.ppf(0.975))[of_size]
    error = np.where(n > 1, few * MEDIAN_ERROR * scatter * np.sqrt(inflation / np.maximum(n, 1)), np.nan)
    return median, error, n.astype(np.int64)


def _median_by(group: IndexArray, values: FloatArray, n: IndexArray) -> FloatArray:
    ordered = values[np.lexsort((values, group))]
    begin = np.concatenate([[0], np.cumsum(n)[:-1]])
    filled = n > 0
    median = np.full(len(n), np.nan)
    low, high = begin[filled] + (n[filled] - 1) // 2, begin[filled] + n[filled] // 2
    median[filled] = (ordered[low] + ordered[high]) / 2
    return median
