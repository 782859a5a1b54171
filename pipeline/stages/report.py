"""Write the files of a job: meshes, tables, results.json. The same input gives the same bytes."""

import csv
from collections.abc import Iterable, Sequence
from pathlib import Path

import numpy as np
import open3d as o3d

from pipeline.analysis import Analysis
from pipeline.mesh import Mesh
from pipeline.outcome import Landmark, Landmarks

VERTEX_COLUMNS = ("vertex", "x_mm", "y_mm", "z_mm", "segment", "halo", "rho", "delta", "t2", "landmark")
LANDMARK_COLUMNS = (
    *("mesh", "id", "vertex", "x_mm", "y_mm", "z_mm", "nx", "ny", "nz"),
    *("segment", "t2", "strength", "matched_to"),
)


def write_mesh(path: Path, mesh: Mesh) -> None:
    """Binary PLY in double precision: the vertices are exactly those that results index."""
    vertices = o3d.utility.Vector3dVector(np.array(mesh.vertices))
    if mesh.is_cloud:
        written = o3d.io.write_point_cloud(str(path), o3d.geometry.PointCloud(vertices))
    else:
        faces = o3d.utility.Vector3iVector(np.array(mesh.faces))
        shape = o3d.geometry.TriangleMesh(vertices, faces)
        written = o3d.io.write_triangle_mesh(str(path), shape, write_vertex_normals=False)
    if not written:
        raise OSError(f"{path.name} could not be written")


def write_vertices(path: Path, analysis: Analysis) -> None:
    """One row a vertex of the cleaned mesh, in the mesh's own frame; values from the nearest surface point of the
    working mesh.
    """
    working = analysis.resampled.working_of_clean
    segmentation, t2 = analysis.segmentation, analysis.landmarks.t2_all
    marked = np.zeros(len(working), dtype=np.int64)
    marked[analysis.landmark_vertices] = 1
    columns: list[Sequence[object]] = [
        range(len(working)),
        *(analysis.mesh.vertices[:, k].tolist() for k in range(3)),
        segmentation.labels[working].tolist(),
        segmentation.halo[working].astype(int).tolist(),
        segmentation.rho[working].tolist(),
        segmentation.delta[working].tolist(),
        t2[working].tolist(),
        marked.tolist(),
    ]
    _write_csv(path, VERTEX_COLUMNS, zip(*columns, strict=True))


def write_landmarks(path: Path, landmarks: Landmarks) -> None:
    """All landmarks of both meshes, each in its own mesh's frame; `matched_to` is the id on the other mesh."""
    of_design = {match.design: match.scan for match in landmarks.matches}
    of_scan = {match.scan: match.design for match in landmarks.matches}
    rows = [_row("design", landmark, of_design) for landmark in landmarks.design]
    rows += [_row("scan", landmark, of_scan) for landmark in landmarks.scan]
    _write_csv(path, LANDMARK_COLUMNS, rows)


def _row(mesh: str, landmark: Landmark, matched_to: dict[int, int]) -> tuple[object, ...]:
    return (
        *(mesh, landmark.id, landmark.vertex, *landmark.position_mm, *landmark.normal),
        *(landmark.segment, landmark.t2, landmark.strength, matched_to.get(landmark.id, "")),
    )


def _write_csv(path: Path, header: Sequence[str], rows: Iterable[Sequence[object]]) -> None:
    with path.open("w", newline="", encoding="utf-8") as stream:
        writer = csv.writer(stream, lineterminator="\n")
        writer.writerow(header)
        writer.writerows(rows)
