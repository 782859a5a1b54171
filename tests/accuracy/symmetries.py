"""Under which motions is a shape its own image, exactly or nearly? And what does a cut-off piece of it still
tell?

Found by registering samples of the shape to the shape itself: from every rotation of the cube and every
n-fold turn (n <= 12) in its principal axes, and from random rotations, each about the centroid, by ICP on the
exact surface. No part of the pipeline's own pose search is used, so the truths of the gauntlet do not rest on
what they judge.

`python -m tests.accuracy.symmetries FILE...` prints both lists, proper and mirrored, of each file.
"""

import sys
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from pipeline.core.mesh import FloatArray, Mesh
from pipeline.kernels import icp, rigid, sampling
from pipeline.kernels.surface import Surface

EXACT_RMS, EXACT_MAX = 0.00025, 0.003  # shares of the diagonal: a symmetry up to its triangulation
APART = 0.02  # RMS displacement, share of the diagonal: nearer maps are one
WORST = 0.05  # a map that leaves more is none
POINTS, FEW = 4000, 200
RANDOM_STARTS = 60
KEPT_STARTS = 40
LARGEST_GROUP = 60
MOST_RIVALS = 12  # of the near maps, the best


@dataclass(frozen=True, slots=True)
class SelfMap:
    """T : (4, 4) design to design; rms, max : of the distances it leaves, shares of the diagonal"""

    T: FloatArray
    rms: float
    max: float

    @property
    def exact(self) -> bool:
        return self.rms <= EXACT_RMS and self.max <= EXACT_MAX


def self_maps(mesh: Mesh, *, mirrored: bool = False) -> list[SelfMap]:
    """Motions that put the shape (its mirror image at x -> -x) on itself within `WORST`; the best first.

    The exact ones are completed to a group.
    """
    surface, samples = Surface(mesh), sampling.on_surface(mesh, POINTS, 0)
    flip = np.diag([-1.0 if mirrored else 1.0, 1.0, 1.0])
    points, normals = samples.points @ flip, samples.normals @ flip
    piece = _Piece(points, normals, surface, mesh.diagonal_mm)
    few = piece.some(FEW)
    coarse = [few.refined(T, iterations=6) for T in _starts(points, samples.points.mean(axis=0))]
    order = np.argsort([few.left(T)[0] for T in coarse], kind="stable")
    cheapest = few.apart_from_each_other([coarse[number] for number in order], APART)[:KEPT_STARTS]
    refined = [few.refined(T, iterations=25) for T in cheapest]
    maps = piece.distinct([T for T in refined if few.left(T)[0] < WORST])
    return maps if mirrored else _group(maps, piece)


def rivals(kept: Mesh, design: Mesh, maps: list[SelfMap]) -> list[SelfMap]:
    """Other poses of a piece cut from `design` (in place, without noise) that the piece itself speaks against
    little.

    Started from `maps`, the near self-maps of the whole; the motions returned are as in `self_maps`, and may
    hold for the piece only.
    """
    samples = sampling.on_surface(kept, POINTS // 2, 0)
    piece = _Piece(samples.points, samples.normals, Surface(design), design.diagonal_mm)
    here = np.eye(4)
    starts = [each.T for each in maps if not each.exact][:MOST_RIVALS]
    refined = [piece.some(FEW).refined(T, iterations=25) for T in starts]
    return [each for each in piece.distinct(refined) if piece.apart(each.T, here) > APART]


def drift(scan_in_place: Mesh, design: Mesh) -> float:
    """How far from the truth the surfaces themselves pull the scan: RMS displacement of ICP started there,
    share of the diagonal. Above the tolerance nothing that looks at surfaces can be right.
    """
    samples = sampling.on_surface(scan_in_place, POINTS, 0)
    piece = _Piece(samples.points, samples.normals, Surface(design), design.diagonal_mm)
    return piece.apart(piece.refined(np.eye(4), iterations=40, reach=0.03), np.eye(4))


@dataclass(frozen=True, slots=True)
class _Piece:
    """points, normals : (k, 3) that are laid on `surface`; size_mm : the diagonal all shares are of"""

    points: FloatArray
    normals: FloatArray
    surface: Surface
    size_mm: float

    def some(self, count: int) -> "_Piece":
        chosen = np.random.default_rng(0).permutation(len(self.points))[:count]
        return _Piece(self.points[chosen], self.normals[chosen], self.surface, self.size_mm)

    def refined(self, T: FloatArray, iterations: int, reach: float = 0.15) -> FloatArray:
        weights = np.full(len(self.points), 1.0 / len(self.points))
        return icp.refine(
            *(self.points, self.normals, weights, self.surface, T),
            max_distance_mm=reach * self.size_mm,
            max_iterations=iterations,
            tolerance_mm=1e-5 * self.size_mm,
        ).T_target_source

    def left(self, T: FloatArray) -> tuple[float, float]:
        distance = self.surface.closest(rigid.transformed(T, self.points)).distance / self.size_mm
        return float(np.sqrt((distance**2).mean())), float(distance.max())

    def apart(self, T_a: FloatArray, T_b: FloatArray) -> float:
        return rigid.rms_displacement(T_a, T_b, self.points) / self.size_mm

    def distinct(self, poses: list[FloatArray]) -> list[SelfMap]:
        """The poses refined to the end on all points, each counted once, the best first."""
        ends = [
            self.refined(T, iterations=40, reach=0.1) for T in self.apart_from_each_other(poses, APART / 2)
        ]
        maps = sorted((SelfMap(T, *self.left(T)) for T in ends), key=lambda each: each.rms)
        distinct = self.apart_from_each_other([each.T for each in maps if each.rms < WORST], APART)
        return [each for each in maps if any(each.T is T for T in distinct)]

    def apart_from_each_other(self, poses: list[FloatArray], share: float) -> list[FloatArray]:
        """Of poses nearer than `share` of the diagonal the first."""
        firsts: list[FloatArray] = []
        for T in poses:
            if all(self.apart(T, other) > share for other in firsts):
                firsts.append(T)
        return firsts


def _group(maps: list[SelfMap], piece: _Piece) -> list[SelfMap]:
    """With every product of two exact maps that the search missed."""
    exact = [each.T for each in maps if each.exact]
    for _ in range(LARGEST_GROUP):
        products = [T_a @ T_b for T_a in exact for T_b in exact]
        new = piece.some(FEW).apart_from_each_other([*exact, *products], APART)[len(exact) :]
        if not new or len(exact) > LARGEST_GROUP:
            break
        exact += [piece.refined(T, iterations=40, reach=0.1) for T in new]
    return sorted(
        [*(SelfMap(T, *piece.left(T)) for T in exact), *(each for each in maps if not each.exact)],
        key=lambda each: each.rms,
    )


def _starts(points: FloatArray, onto: FloatArray) -> list[FloatArray]:
    """Rotations about the centroid of `points`, which is then moved to `onto`."""
    centre = points.mean(axis=0)
    _, _, axes = np.linalg.svd(points - centre, full_matrices=False)
    axes[2] *= np.linalg.det(axes)
    turns = [axes.T @ R @ axes for R in Rotation.create_group("O").as_matrix()]
    turns += [
        Rotation.from_rotvec(2 * np.pi * k / n * axis).as_matrix()
        for axis in axes
        for n in range(3, 13)
        for k in range(1, n)
        if np.gcd(k, n) == 1
    ]
    turns += list(Rotation.random(RANDOM_STARTS, rng=np.random.default_rng(0)).as_matrix())
    return [rigid.rotation_about(R, centre, onto) for R in turns]


def main() -> None:
    from tests.accuracy.bench import read

    for name in sys.argv[1:]:
        mesh = read(Path(name))
        for mirrored in (False, True):
            print(Path(name).stem, "onto its mirror image" if mirrored else "onto itself")
            for each in self_maps(mesh, mirrored=mirrored)[:16]:
                turn = Rotation.from_matrix(each.T[:3, :3]).as_rotvec(degrees=True)
                axis = (turn / max(np.linalg.norm(turn), 1e-9)).round(2)
                what = "exact" if each.exact else "     "
                print(f"  {what} {100 * each.rms:.3f} % rms, {100 * each.max:.2f} % max, ", end="")
                print(f"{np.linalg.norm(turn):.1f} degrees about {axis.tolist()}")


if __name__ == "__main__":
    main()
