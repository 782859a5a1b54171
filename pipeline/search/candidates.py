"""Candidate poses, before any of them is tried: from pairs of matched descriptors, and from principal axes.

Three sources that fail independently: descriptors of landmarks, descriptors of evenly spread points, and the
24 poses that align the principal axes. Two corresponding oriented points fix a pose.
"""

import numpy as np

from pipeline.core.mesh import FloatArray, IndexArray, Mesh
from pipeline.core.settings import MatchingSettings
from pipeline.kernels import fpfh, poses, topology
from pipeline.kernels.nearest import k_nearest
from pipeline.search.schedule import MATCHING
from pipeline.search.types import SOURCES, DescribedMesh, PosePool, Source


def generate_candidates(
    design: DescribedMesh,
    scan: DescribedMesh,
    design_points: FloatArray,
    scan_points: FloatArray,
    length_mm: float,
    settings: MatchingSettings,
) -> PosePool:
    """Every candidate of every source, with cost 0.

    design_points, scan_points : (k, 3), (l, 3) even samples of both surfaces; length_mm : unit of length of
    matching

    An open surface does not tell its outside from its inside (depth-camera meshes come either way), so where
    one of the two is open, poses are also generated with the scan's normals flipped.
    """
    pairs = _PairGenerator(design, scan, length_mm, settings)
    spread, everywhere = scan.spread[: MATCHING.dense_points], design.spread
    groups: list[tuple[FloatArray, float, Source]] = []
    for sign in (1.0, -1.0) if _is_open(scan.mesh) or _is_open(design.mesh) else (1.0,):
        if min(len(design.landmarks.vertex), len(scan.landmarks.vertex)) >= 2:
            scan_vertex = scan.landmarks.vertex[: MATCHING.max_landmarks]
            design_vertex = design.landmarks.vertex[: MATCHING.max_landmarks]
            groups.append(
                (pairs.poses(scan_vertex, design_vertex, settings.candidates, sign), sign, "landmarks")
            )
        if settings.dense_pairs:
            dense = pairs.poses(spread, everywhere, MATCHING.dense_candidates, sign)
            groups.append((dense, sign, "dense"))
        if settings.axes_poses or sum(len(T) for T, _, _ in groups) == 0:
            groups.append((poses.from_axes(scan_points, design_points), sign, "axes"))
    return PosePool(
        np.concatenate([T for T, _, _ in groups]),
        np.concatenate([np.full(len(T), sign) for T, sign, _ in groups]),
        np.concatenate([np.full(len(T), SOURCES.index(source)) for T, _, source in groups]),
        np.zeros(sum(len(T) for T, _, _ in groups)),
    )


class _PairGenerator:
    """Poses from pairs of correspondences, each between points of similar descriptors."""

    def __init__(
        self, design: DescribedMesh, scan: DescribedMesh, length_mm: float, settings: MatchingSettings
    ) -> None:
        self._design, self._scan, self._length_mm, self._settings = design, scan, length_mm, settings
        self._scan_normals = scan.mesh.vertex_normals()
        self._design_normals = design.mesh.vertex_normals()

    def poses(
        self, scan_vertex: IndexArray, design_vertex: IndexArray, candidates: int, normal_sign: float
    ) -> FloatArray:
        """(h, 4, 4) T_design_scan. scan_vertex, design_vertex : the vertices considered; candidates : of the
        design for each of the scan
        """
        of_scan = self._scan.descriptors.at(scan_vertex)
        of_scan = of_scan if normal_sign > 0 else fpfh.flip_normals(of_scan)
        i, j = _nearest_descriptors(of_scan, self._design.descriptors.at(design_vertex), candidates)
        i, j = scan_vertex[i], design_vertex[j]
        return poses.from_oriented_pairs(
            (self._scan.mesh.vertices[i], normal_sign * self._scan_normals[i]),
            (self._design.mesh.vertices[j], self._design_normals[j]),
            length_tolerance_mm=MATCHING.pair_length_tolerance_lengths * self._length_mm,
            min_length_mm=MATCHING.min_pair_length_lengths * self._length_mm,
            max_pairs=self._settings.max_pairs,
        )


def _nearest_descriptors(
    scan_fpfh: FloatArray, design_fpfh: FloatArray, candidates: int
) -> tuple[IndexArray, IndexArray]:
    """Index pairs (scan, design): for each scan descriptor its `candidates` nearest of the design."""
    k = min(candidates, len(design_fpfh))
    return np.repeat(np.arange(len(scan_fpfh)), k), k_nearest(design_fpfh, scan_fpfh, k).ravel()


def _is_open(mesh: Mesh) -> bool:
    return bool(topology.border_vertices(mesh.faces, len(mesh.vertices)).any())
