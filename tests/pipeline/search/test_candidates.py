"""Candidate poses: the true motion is among those of every source, and flipped normals are tried on open
surfaces.
"""

import numpy as np
import pytest

from pipeline.core.landmark_set import LandmarkSet
from pipeline.core.mesh import Mesh
from pipeline.core.settings import MatchingSettings
from pipeline.kernels import rigid, sampling
from pipeline.search.candidates import generate_candidates
from pipeline.search.types import SOURCES, DescribedMesh, PosePool
from tests.support import shapes

LENGTH_MM = 1.5


def described(mesh: Mesh, vertices: np.ndarray[tuple[int], np.dtype[np.int64]]) -> DescribedMesh:
    """A mesh with landmarks at these vertices."""
    zeros = np.zeros(len(vertices))
    landmarks = LandmarkSet(
        vertices,
        mesh.vertices[vertices],
        mesh.vertex_normals()[vertices],
        vertices * 0,
        zeros,
        zeros,
        zeros,
        0.0,
    )
    return DescribedMesh.of(mesh, landmarks, MatchingSettings().descriptor_radius_lengths * LENGTH_MM)


def candidates(design: Mesh, scan: Mesh, settings: MatchingSettings) -> PosePool:
    some = np.arange(0, len(design.vertices), max(1, len(design.vertices) // 30))
    points = (sampling.on_surface(mesh, 1000, 0).points for mesh in (design, scan))
    return generate_candidates(described(design, some), described(scan, some), *points, LENGTH_MM, settings)


@pytest.mark.parametrize("source", SOURCES)
def test_the_true_motion_is_among_the_candidates_of_each_source(source: str) -> None:
    design = shapes.bumpy_blob(3)
    T_design_scan = shapes.motion(5)
    scan = design.moved(rigid.inverse(T_design_scan))
    pool = candidates(design, scan, MatchingSettings(max_pairs=2000))
    T = pool.T[pool.source == SOURCES.index(source)]  # type: ignore[arg-type]
    error_mm = min(rigid.rms_displacement(each, T_design_scan, scan.vertices) for each in T)
    assert error_mm < 0.04 * design.diagonal_mm  # within the reach of a short ICP


def test_flipped_normals_are_tried_only_where_a_surface_is_open() -> None:
    closed = shapes.bumpy_blob(3)
    opened = Mesh(closed.vertices, closed.faces[closed.vertices[closed.faces].mean(axis=1)[:, 2] > -5])
    settings = MatchingSettings(max_pairs=200)
    assert set(candidates(closed, closed, settings).normal_sign) == {1.0}
    assert set(candidates(closed, opened, settings).normal_sign) == {1.0, -1.0}
