"""An upper dental arch by formula, and a "print" of it with known truth. Millimetres, no data files.

The surface is where a field is zero: the smooth union of 14 crowns and the gum along the arch curve
(the crowns are in `demo_crowns.py`; the seed varies each tooth, as no real arch is its own mirror image).

The surface is swept: in the section across the arch at s a ray leaves the arch's axis at each angle, and the
vertex is its outermost crossing. So the steep sides of a crown are as well covered as its top, and the only
border is the rim of the swept patch, as in an intraoral scan: one loop around the bottom of the gum.
"""

from dataclasses import dataclass
from functools import lru_cache
from typing import TypeAlias

import numpy as np
import numpy.typing as npt
from scipy.interpolate import CubicSpline, PchipInterpolator, RegularGridInterpolator
from scipy.ndimage import gaussian_filter1d
from scipy.spatial import Delaunay
from scipy.spatial.transform import Rotation

from service.demo.crowns import KINDS, crown_field, smax, smin

FloatArray: TypeAlias = npt.NDArray[np.float64]
IntArray: TypeAlias = npt.NDArray[np.int32]

SHRINK = 0.004  # of the length, as resins do
WARP_MM = 0.15  # largest displacement of the smooth warp
NOISE_MM = 0.02  # standard deviation of each coordinate
POSE_MM = 50.0  # longest translation of the scan

HALF_WIDTH_MM, DEPTH_MM, SQUARENESS = 25.0, 46.0, 2.3  # of the arch curve, a superellipse
GUM_BEHIND_MM = 5.0  # past the last molar
AXIS_Z_MM = 0.5  # where the rays of a section start, above the gum line
RAY_LIMIT = np.radians(130.0)  # from straight up, to either side
FARTHEST_MM = 15.0  # no surface beyond this along a ray
RELAXATIONS = 20


@dataclass(frozen=True, slots=True)
class Surface:
    """Triangles: vertices (n, 3) float64 mm, faces (m, 3) int32, counter-clockwise seen from outside."""

    vertices: FloatArray
    faces: IntArray


@dataclass(frozen=True, slots=True)
class Printed:
    """A scan of a print, and the (4, 4) motion that puts it back: p_design_mm = T_design_scan @ p_scan_mm."""

    scan: Surface
    T_design_scan: FloatArray


def arch(n_vertices: int = 5000, seed: int = 0) -> Surface:
    """The design: a regular grid over the swept patch, each quad cut along its shorter diagonal.

    n_vertices : about how many; seed : of the variation of the teeth
    """
    sweep = _sweep(seed)
    rows, columns = sweep.grid(n_vertices)
    patch = np.stack(np.meshgrid(_unit(rows), _unit(columns), indexing="ij"), axis=2).reshape(-1, 2)
    corner = np.arange(rows * columns).reshape(rows, columns)
    a, b, c, d = (q.ravel() for q in (corner[:-1, :-1], corner[1:, :-1], corner[1:, 1:], corner[:-1, 1:]))
    sides = np.unique(
        np.concatenate([np.stack(pair, 1) for pair in ((a, b), (a, d), (b, c), (d, c))]), axis=0
    )
    vertices = sweep.points(patch, sides)
    ac, bd = (np.linalg.norm(vertices[p] - vertices[q], axis=1) for p, q in ((a, c), (b, d)))
    cut_ac, cut_bd = np.stack([a, b, c, a, c, d], 1), np.stack([a, b, d, b, c, d], 1)
    faces = np.where((ac <= bd)[:, None], cut_ac, cut_bd).reshape(-1, 3)
    return Surface(vertices, faces.astype(np.int32))


def printed(n_vertices: int = 6500, seed: int = 0) -> Printed:
    """A print of `arch(seed=seed)`, scanned: triangulated anew, shrunk, warped, noisy, moved.

    Its vertices are jittered staggered rows joined by Delaunay: none is a vertex of the design. The
    rigid part of the deformation is taken out: the truth is the best rigid answer, in least squares.
    """
    rng = np.random.default_rng([seed, 1])
    sweep = _sweep(seed)
    patch = _staggered(*sweep.grid(n_vertices), rng)
    flat = patch * [sweep.length_mm, sweep.girth_mm]
    faces = np.asarray(Delaunay(flat).simplices)
    p, q, r = (flat[faces[:, k]] for k in range(3))
    cross = (q - p)[:, 0] * (r - p)[:, 1] - (q - p)[:, 1] * (r - p)[:, 0]
    faces = np.where((cross > 0)[:, None], faces, faces[:, ::-1])[np.abs(cross) > 1e-6]  # slivers on the rim
    sides = np.sort(np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]]), axis=1)
    ideal = sweep.points(patch, np.unique(sides, axis=0))

    deformed = _deformed(ideal, rng)
    away = rng.normal(size=3)
    away *= rng.uniform(0.2, 1.0) * POSE_MM / np.linalg.norm(away)
    T_design_scan = np.eye(4)
    T_design_scan[:3, :3] = Rotation.random(random_state=int(rng.integers(2**31))).as_matrix()
    T_design_scan[:3, 3] = -T_design_scan[:3, :3] @ away
    scan = (deformed - T_design_scan[:3, 3]) @ T_design_scan[:3, :3]
    return Printed(Surface(scan, faces.astype(np.int32)), T_design_scan)


class _Sweep:
    """The arch of one seed as a patch [0, 1]^2: along it from right to left, across from tongue to cheek."""

    def __init__(self, seed: int) -> None:
        rng = np.random.default_rng([seed, 0])
        sizes = np.array([kind.width for kind in KINDS]) * 0.98  # neighbours touch
        self._edges = np.concatenate([[0.0], np.cumsum(sizes)]) - sizes.sum() / 2
        self._centres = (self._edges[1:] + self._edges[:-1]) / 2
        self._scale = 1.0 + 0.025 * rng.uniform(-1, 1, (len(KINDS), 3))
        self._turn = np.radians(6.0) * rng.uniform(-1, 1, len(KINDS))
        self._shift = rng.uniform(-1, 1, (len(KINDS), 3)) * [0.0, 0.35, 0.3]
        self._curve = _arch_curve(skew=0.02 * rng.uniform(0.5, 1.0))
        self._end = self._edges[-1] + GUM_BEHIND_MM
        depths = np.array([kind.depth for kind in KINDS]) / 2
        ends = [-self._end, *self._centres, self._end]
        self._gum_depth = PchipInterpolator(ends, [depths[0] - 1.0, *depths, depths[-1] - 1.0])
        self._even_out()

    def grid(self, n_vertices: int) -> tuple[int, int]:
        """Rows and columns of a grid of about n_vertices with cells as square as they can be."""
        rows = max(4, round(np.sqrt(n_vertices * self.length_mm / self.girth_mm)))
        return rows, max(4, round(n_vertices / rows))

    def points(self, patch: FloatArray, edges: npt.NDArray[np.int64]) -> FloatArray:
        """(n, 2) in the patch, joined by (e, 2) edges -> (n, 3) mm on the surface, slid until well spread."""
        s = np.interp(patch[:, 0], _unit(len(self._s_of)), self._s_of)
        section = np.stack([s, self._angle_of(np.stack([s, patch[:, 1]], axis=1))], axis=1)
        free = (patch > 0.0) & (patch < 1.0)  # the rim slides along itself only
        start, stop = edges.T
        for _ in range(RELAXATIONS):  # longer edges pull harder
            rough = self._rough(section)
            pull = np.linalg.norm(rough[start] - rough[stop], axis=1)
            total = np.bincount(start, pull, len(patch)) + np.bincount(stop, pull, len(patch))
            for k in range(2):
                there = np.bincount(start, pull * section[stop, k], len(patch))
                here = np.bincount(stop, pull * section[start, k], len(patch))
                section[:, k] += np.where(free[:, k], 0.3 * ((there + here) / total - section[:, k]), 0.0)
        return self._cast(section[:, 0], section[:, 1])

    def _even_out(self) -> None:
        """Choose s and angle over the patch so that equal steps are about equal lengths on the surface."""
        s, angle = np.linspace(-self._end, self._end, 201), np.linspace(-RAY_LIMIT, RAY_LIMIT, 65)
        grid_s, grid_angle = np.meshgrid(s, angle, indexing="ij")
        points = self._cast(grid_s.ravel(), grid_angle.ravel()).reshape(len(s), len(angle), 3)
        self._rough = RegularGridInterpolator((s, angle), points, bounds_error=False, fill_value=None)
        steps = np.linalg.norm(np.diff(points, axis=1), axis=2)
        steps = gaussian_filter1d(steps, 2.0 / (s[1] - s[0]), axis=0, mode="nearest")  # over 2 mm
        lengths = np.concatenate([np.zeros((len(s), 1)), np.cumsum(steps, axis=1)], axis=1)
        self.girth_mm = float(lengths[:, -1].mean())
        across = _unit(len(angle))
        table = np.stack([np.interp(across, row / row[-1], angle) for row in lengths])
        self._angle_of = RegularGridInterpolator((s, across), table)
        strides = gaussian_filter1d(np.linalg.norm(np.diff(points, axis=0), axis=2).mean(axis=1), 1.5)
        walked = np.concatenate([[0.0], np.cumsum(strides)])
        self.length_mm = float(walked[-1])
        self._s_of = np.interp(_unit(len(s)), walked / walked[-1], s)

    def _cast(self, s: FloatArray, angle: FloatArray) -> FloatArray:
        """(n,) sections, (n,) angles from straight up -> (n, 3) the outermost crossings of the rays."""
        inside = np.zeros(len(s))
        above = np.arange(len(s))  # rays still outside
        for reach in np.arange(FARTHEST_MM, 0.0, -0.4):
            within = self._field(s[above], angle[above], np.full(len(above), reach)) < 0.0
            inside[above[within]] = reach
            above = above[~within]
        outside = inside + 0.4
        for _ in range(16):  # to 0.4 mm / 2^16
            middle = (inside + outside) / 2
            within = self._field(s, angle, middle) < 0.0
            inside, outside = np.where(within, middle, inside), np.where(within, outside, middle)
        return self._world(s, inside * np.sin(angle), AXIS_Z_MM + inside * np.cos(angle))

    def _world(self, s: FloatArray, v: FloatArray, z: FloatArray) -> FloatArray:
        tangent = self._curve(s, 1)
        outward = np.stack([-tangent[:, 1], tangent[:, 0]], axis=1)
        outward /= np.linalg.norm(outward, axis=1, keepdims=True)
        return np.concatenate([self._curve(s) + v[:, None] * outward, z[:, None]], axis=1)

    def _field(self, s: FloatArray, angle: FloatArray, reach: FloatArray) -> FloatArray:
        v, z = reach * np.sin(angle), AXIS_Z_MM + reach * np.cos(angle)
        points = self._world(s, v, z)
        field = self._gum(s, v, z)
        at = self._tooth(s)
        for i, kind in enumerate(KINDS):
            near = np.flatnonzero(np.abs(at - i) <= 1)
            if near.size:
                local = self._local(points[near], i)
                field[near] = smin(field[near], crown_field(kind, *local), 0.5)
        return field

    def _tooth(self, s: FloatArray) -> npt.NDArray[np.int64]:
        return np.clip(np.searchsorted(self._edges, s) - 1, 0, len(KINDS) - 1).astype(np.int64)

    def _local(self, points: FloatArray, i: int) -> tuple[FloatArray, FloatArray, FloatArray]:
        """u away from the middle of the arch, v outwards, z up: in tooth i, scaled to its kind's own size."""
        origin = self._curve(self._centres[i])
        tangent = self._curve(self._centres[i], 1)
        heading = np.arctan2(tangent[1], tangent[0]) + self._turn[i]
        x, y = (points[:, :2] - origin).T
        u = (np.cos(heading) * x + np.sin(heading) * y) * (1.0 if i >= len(KINDS) // 2 else -1.0)
        v = -np.sin(heading) * x + np.cos(heading) * y
        u, v, z = ((q - self._shift[i, k]) / self._scale[i, k] for k, q in enumerate((u, v, points[:, 2])))
        return u, v, z

    def _gum(self, s: FloatArray, v: FloatArray, z: FloatArray) -> FloatArray:
        """Scalloped: high between teeth (papillae), low in front of them, with the roots showing below."""
        at = self._tooth(s)
        phase = np.clip((s - self._edges[at]) / np.diff(self._edges)[at], 0.0, 1.0)
        between = np.cos(2.0 * np.pi * phase)  # 1 between teeth, -1 in the middle of one
        below = np.clip(-z, 0.0, None)
        half = self._gum_depth(s) + 1.0 + 0.18 * below - 0.35 * between * np.clip(below, 0.0, 1.0)
        sinking = np.clip(np.abs(s) - self._edges[-1], 0.0, None) ** 2 / GUM_BEHIND_MM
        return smax(np.abs(v) - half, z - (1.0 + 1.5 * between - 0.15 * sinking), 2.4)


@lru_cache(maxsize=4)  # the design and its print are of one sweep
def _sweep(seed: int) -> _Sweep:
    return _Sweep(seed)


def _arch_curve(skew: float) -> CubicSpline:
    """(x, y) by arc length s in mm, 0 at the front: a superellipse, one side a little wider."""
    turn = np.linspace(-0.65 * np.pi, 0.65 * np.pi, 801)
    e = SQUARENESS
    radius = (np.abs(np.sin(turn) / HALF_WIDTH_MM) ** e + np.abs(np.cos(turn) / DEPTH_MM) ** e) ** (-1.0 / e)
    line = np.stack([radius * np.sin(turn) * (1.0 + skew * np.sin(turn)), radius * np.cos(turn)], axis=1)
    line[:, 1] -= DEPTH_MM / 2
    s = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(line, axis=0), axis=1))])
    return CubicSpline(s - s[400], line)


def _staggered(rows: int, columns: int, rng: np.random.Generator) -> FloatArray:
    """(n, 2) in the patch: rows a quarter step to either side in turn, jittered by a sixth; rim straight."""
    patch = np.stack(np.meshgrid(_unit(rows), _unit(columns), indexing="ij"), axis=2)
    move = rng.uniform(-1 / 6, 1 / 6, patch.shape)
    move[..., 1] += np.where(np.arange(rows) % 2 == 0, 0.25, -0.25)[:, None]
    patch[1:-1, 1:-1] += (move / [rows - 1, columns - 1])[1:-1, 1:-1]
    return patch.reshape(-1, 2)


def _deformed(ideal: FloatArray, rng: np.random.Generator) -> FloatArray:
    """(n, 3) -> (n, 3): shrunk, warped by sines of 60 to 120 mm, noisy, moved to lie best on what it was."""
    waves = rng.normal(size=(3, 3))
    waves *= (2.0 * np.pi / rng.uniform(60.0, 120.0, (3, 1))) / np.linalg.norm(waves, axis=1, keepdims=True)
    warp = np.sin(ideal @ waves.T + rng.uniform(0.0, 2.0 * np.pi, 3))
    warp *= WARP_MM / np.linalg.norm(warp, axis=1).max()
    deformed = (1.0 - SHRINK) * ideal + warp + rng.normal(scale=NOISE_MM, size=ideal.shape)
    from_mean, to_mean = deformed.mean(axis=0), ideal.mean(axis=0)
    best, _ = Rotation.align_vectors(ideal - to_mean, deformed - from_mean)
    return np.asarray(best.apply(deformed - from_mean) + to_mean)


def _unit(n: int) -> FloatArray:
    return np.linspace(0.0, 1.0, n)
