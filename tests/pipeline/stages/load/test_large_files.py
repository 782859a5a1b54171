"""Large files: one body is not copied, and the corners of triangles without common vertices are no points."""

from pathlib import Path

import numpy as np
import pytest
import trimesh

from pipeline import MeshFile, errors
from pipeline.core.settings import LoadSettings
from pipeline.stages.load import load
from pipeline.stages.load.contents import Body, Contents, joined
from tests.support import shapes

BOX = shapes.box()
SOUP = trimesh.Trimesh(BOX.vertices[BOX.faces].reshape(-1, 3), np.arange(36).reshape(-1, 3), process=False)


def test_one_body_is_not_copied() -> None:
    body = Body(BOX.vertices.copy(), BOX.faces.astype(np.int64))
    vertices, faces = joined(Contents((body,)))
    assert vertices is body.vertices and faces is body.faces


@pytest.mark.parametrize("kind", ["stl", "ply", "obj", "off", "glb", "3mf"])
def test_corners_without_common_vertices_are_not_counted(kind: str, tmp_path: Path) -> None:
    path = tmp_path / f"soup.{kind}"
    SOUP.export(str(path))
    settings = LoadSettings(max_faces=12, max_points=8)
    assert len(load(MeshFile(path), "design", settings, needs_surface=True).mesh.faces) == 12
    with pytest.raises(errors.MeshTooLarge):
        load(MeshFile(path), "design", LoadSettings(max_faces=11), needs_surface=True)


def test_vertices_of_a_mesh_and_points_are_counted(tmp_path: Path) -> None:
    path = tmp_path / "box.ply"
    more = np.concatenate([BOX.vertices, np.zeros((29, 3))])  # one more than three for each triangle
    trimesh.Trimesh(more, BOX.faces, process=False).export(str(path))
    with pytest.raises(errors.MeshTooLarge, match="37 vertices; the limit is 7"):
        load(MeshFile(path), "design", LoadSettings(max_points=7), needs_surface=True)
