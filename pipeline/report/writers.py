"""Write the files of a job: meshes, tables, results.json. The same input gives the same bytes."""

import csv
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path

import numpy as np
import open3d as o3d
from pydantic_core import to_json

from pipeline.analysis.brep_segments import NO_SEGMENT, areas_mm2, centres_mm, segment_of_brep
from pipeline.core.brep_faces import BrepFaces
from pipeline.core.mesh import FloatArray, IndexArray, IntArray, Mesh
from pipeline.core.reference import Reference
from pipeline.core.results import Check, Landmark, Match
from pipeline.stages.segmentation import Segmentation

VERTEX_COLUMNS = ("vertex", "x_mm", "y_mm", "z_mm", "segment", "halo", "rho", "delta", "t2", "landmark")
LANDMARK_COLUMNS = (
    *("mesh", "id", "vertex", "x_mm", "y_mm", "z_mm", "nx", "ny", "nz"),
    *("segment", "t2", "strength", "matched_to"),
)

BREP_COLUMNS = ("number", "name", "kind", "body", "segment", "area_mm2", "x_mm", "y_mm", "z_mm")
IDENTITY_COLUMNS = ("part_number", "serial", "batch", "order", "machine", "operator", "gauge")
CHECK_COLUMNS = (
    *("name", "kind", "region", "value", "lower", "upper", "unit", "standard_error", "n", "result"),
    *("x_mm", "y_mm", "z_mm"),
)
#: Of a check, by `passed`.
RESULTS = {True: "passed", False: "failed", None: "not_judged"}


def write_mesh(path: Path, mesh: Mesh, colours: FloatArray | None = None) -> None:
    """Binary PLY in double precision: the vertices are exactly those that results index.

    colours : (n, 3) red, green, blue in [0, 1], or none in the file
    """
    vertices = o3d.utility.Vector3dVector(np.array(mesh.vertices))
    painted = o3d.utility.Vector3dVector(np.zeros((0, 3)) if colours is None else colours)
    if mesh.is_cloud:
        cloud = o3d.geometry.PointCloud(vertices)
        cloud.colors = painted
        written = o3d.io.write_point_cloud(str(path), cloud)
    else:
        faces = o3d.utility.Vector3iVector(np.array(mesh.faces))
        shape = o3d.geometry.TriangleMesh(vertices, faces)
        shape.vertex_colors = painted
        written = o3d.io.write_triangle_mesh(str(path), shape, write_vertex_normals=False)
    if not written:
        raise OSError(f"{path.name} could not be written")


def write_vertices(
    path: Path,
    mesh: Mesh,
    working_of_clean: IndexArray,
    segmentation: Segmentation,
    t2: FloatArray | None = None,
    landmark_vertices: IndexArray | None = None,
) -> None:
    """One row per vertex of the cleaned `mesh`, in its own frame; values from the nearest point of the
    working mesh. Without a landmark search (`t2` and `landmark_vertices` None), t2 and landmark are 0.
    """
    t2 = np.zeros(len(segmentation.labels)) if t2 is None else t2
    marked = np.zeros(len(working_of_clean), dtype=np.int64)
    if landmark_vertices is not None:
        marked[landmark_vertices] = 1
    # Numbers formatted as by `csv`, but once per working vertex, which about a hundred vertices share.
    columns = (segmentation.labels, segmentation.halo.astype(int), segmentation.rho, segmentation.delta, t2)
    found = [
        f"{segment},{halo},{rho!r},{delta!r},{t!r}"
        for segment, halo, rho, delta, t in zip(*(column.tolist() for column in columns), strict=True)
    ]
    # Shortest digits that give the same number back, for all vertices in one call.
    places = to_json(mesh.vertices.tolist()).decode()[2:-2].split("],[")
    rows = zip(places, working_of_clean.tolist(), marked.tolist(), strict=True)
    with path.open("w", newline="", encoding="utf-8") as stream:
        stream.write(",".join(VERTEX_COLUMNS) + "\n")
        stream.writelines(
            f"{vertex},{place},{found[working]},{mark}\n"
            for vertex, (place, working, mark) in enumerate(rows)
        )


def write_landmarks(
    path: Path, landmarks: Mapping[str, Sequence[Landmark]], matches: Sequence[Match] = ()
) -> None:
    """All landmarks by mesh, each in its own mesh's frame; `matched_to` is the id on the other mesh."""
    partners = {
        "design": {match.design: match.scan for match in matches},
        "scan": {match.scan: match.design for match in matches},
    }
    rows = [_row(mesh, each, partners.get(mesh, {})) for mesh, found in landmarks.items() for each in found]
    _write_csv(path, LANDMARK_COLUMNS, rows)


def write_brep_faces(path: Path, mesh: Mesh, brep: BrepFaces, segment_of_face: IntArray) -> None:
    """A row for each face of the CAD model: its area and centroid on the cleaned `mesh`, and the segment that
    holds most of it; empty where it has no triangles there. segment_of_face : (m,)
    """
    segment = segment_of_brep(mesh, brep, segment_of_face)
    rows = zip(brep.faces, segment.tolist(), areas_mm2(mesh, brep), centres_mm(mesh, brep), strict=True)
    _write_csv(
        path,
        BREP_COLUMNS,
        (
            (
                *(number, face.name, face.kind, face.body),
                *(("", 0.0, "", "", "") if at == NO_SEGMENT else (at, float(area), *centre.tolist())),
            )
            for number, (face, at, area, centre) in enumerate(rows)
        ),
    )


def write_characteristics(path: Path, checks: Sequence[Check], reference: Reference | None) -> None:
    """A row for each check of an inspection, with the identity of the part in front; lengths in mm."""
    identity = [None if reference is None else getattr(reference, name) for name in IDENTITY_COLUMNS]
    _write_csv(
        path,
        (*IDENTITY_COLUMNS, *CHECK_COLUMNS),
        (
            (
                *identity,
                *(check.name, check.kind, check.region, check.value, check.lower, check.upper, check.unit),
                *(check.uncertainty, check.n, RESULTS[check.passed]),
                *(check.position_mm or (None, None, None)),
            )
            for check in checks
        ),
    )


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
