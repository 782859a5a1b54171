"""Meshes by formula as a scanner would bring them: noisy, elsewhere, in a file."""

from pathlib import Path

import numpy as np
import trimesh

from pipeline.core.mesh import FloatArray, Mesh
from tests.support import shapes

NOISE_MM = 0.02


def save(mesh: Mesh, path: Path) -> Path:
    """The mesh as a file of the format that the ending of `path` names; points as text."""
    if mesh.is_cloud:
        np.savetxt(path, mesh.vertices, fmt="%.9g")
    else:
        trimesh.Trimesh(mesh.vertices, mesh.faces, process=False).export(path)
    return path


def scanned(T_scan_design: FloatArray, *, levels: int = 4, seed: int = 0) -> Mesh:
    """The blob with another triangulation, noise of NOISE_MM along the normals, and elsewhere."""
    blob = shapes.bumpy_blob(levels, triangulation=7)
    noise = np.random.default_rng(seed).normal(0, NOISE_MM, len(blob.vertices))
    return Mesh(blob.vertices + noise[:, None] * blob.vertex_normals(), blob.faces).moved(T_scan_design)


def noisy(mesh: Mesh, seed: int) -> Mesh:
    """The same vertices with noise of NOISE_MM along the normals, moved by `shapes.motion(seed)`."""
    noise = np.random.default_rng(seed).normal(0, NOISE_MM, len(mesh.vertices))
    return Mesh(mesh.vertices + noise[:, None] * mesh.vertex_normals(), mesh.faces).moved(shapes.motion(seed))
