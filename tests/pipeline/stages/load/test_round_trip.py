"""What each program at hand writes, in each format, option and byte order, is read as the same geometry."""

from pathlib import Path

import numpy as np
import pytest

from pipeline import MeshFile
from pipeline.core.mesh import FloatArray, Mesh
from pipeline.core.settings import LoadSettings
from pipeline.stages.load import Loaded, load
from tests.support import shapes
from tests.support.mesh_writers import CLOUD_WRITERS, MESH_WRITERS

#: Without symmetry, off the origin, and exact in single precision.
SHAPE = shapes.bumpy_blob(1)
VERTICES = np.round(SHAPE.vertices * 8.0) / 8.0 + np.array([30.0, -20.0, 10.0])
FACES = SHAPE.faces
#: Millimetres of what the unit of the file is, where it declares another.
MM = {("lib3mf", "3mf", "inch"): 25.4} | {key: 1000.0 for key in MESH_WRITERS if key[1] == "glb"}
PAGE = Path(__file__).parents[4] / "docs" / "formats.md"


def read_back(key: tuple[str, str, str], writers: object, tmp_path: Path) -> Loaded:
    assert isinstance(writers, dict)
    path = tmp_path / f"part.{key[1]}"
    writers[key](path, VERTICES.copy(), FACES.copy())
    return load(MeshFile(path, filename=path.name), "scan", LoadSettings(), needs_surface=False)


def triangles(mesh: Mesh, mm: float) -> FloatArray:
    """(m, 9) corners of all triangles, each from its first corner on by size, and sorted: their order, and
    that of the vertices, is free, and the orientation is not.
    """
    corners = np.round(mesh.vertices[mesh.faces] / mm * 64.0) / 64.0
    rows = []
    for triangle in corners.tolist():
        start = triangle.index(min(triangle))
        rows.append([x for k in range(3) for x in triangle[(start + k) % 3]])
    return np.array(sorted(rows))


EXPECTED = triangles(Mesh(VERTICES, FACES), 1.0)


@pytest.mark.parametrize("key", MESH_WRITERS, ids=" ".join)
def test_a_mesh_is_read_as_it_was_written(key: tuple[str, str, str], tmp_path: Path) -> None:
    loaded = read_back(key, MESH_WRITERS, tmp_path)
    mm = MM.get(key, 1.0)
    np.testing.assert_allclose(triangles(loaded.mesh, mm), EXPECTED, atol=1e-9)
    np.testing.assert_allclose(
        np.unique(loaded.mesh.vertices / mm, axis=0).mean(axis=0), VERTICES.mean(axis=0), atol=1e-4
    )
    assert loaded.notes == ()


@pytest.mark.parametrize("key", CLOUD_WRITERS, ids=" ".join)
def test_points_are_read_as_they_were_written(key: tuple[str, str, str], tmp_path: Path) -> None:
    loaded = read_back(key, CLOUD_WRITERS, tmp_path)
    assert loaded.mesh.is_cloud
    np.testing.assert_allclose(loaded.mesh.vertices, VERTICES, atol=1e-5)


def matrix() -> list[str]:
    """The rows of the table on the page: a program, its formats and their options."""
    rows: dict[str, dict[str, list[str]]] = {}
    for program, kind, option in (*MESH_WRITERS, *CLOUD_WRITERS):
        rows.setdefault(program, {}).setdefault(kind.upper(), []).append(option)
    return [
        f"| {program} | "
        + "; ".join(f"{kind} ({' / '.join(options)})" for kind, options in kinds.items())
        + " |"
        for program, kinds in rows.items()
    ]


def test_the_page_lists_the_matrix() -> None:
    assert "\n".join(matrix()) in PAGE.read_text(), "\n".join(matrix())
