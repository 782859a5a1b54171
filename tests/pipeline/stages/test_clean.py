"""Cleaning removes what it says, and the index it returns leads back to the file's vertices."""

import numpy as np
import pytest

from pipeline.core import errors
from pipeline.core.mesh import Mesh
from pipeline.core.settings import CleanSettings
from pipeline.kernels import topology
from pipeline.kernels.rows import group_rows
from pipeline.stages.clean import Cleaned, clean
from tests.support import shapes


def cleaned(mesh: Mesh, **settings: float | bool) -> Cleaned:
    found = clean(mesh, "scan", CleanSettings(**settings))  # type: ignore[arg-type]
    np.testing.assert_array_equal(mesh.vertices[found.old_of_new], found.mesh.vertices)
    return found


def soup(mesh: Mesh) -> Mesh:
    """As an STL holds it: every triangle with corners of its own."""
    return Mesh(mesh.vertices[mesh.faces].reshape(-1, 3), np.arange(3 * len(mesh.faces)).reshape(-1, 3))


def test_triangle_soup_becomes_the_closed_mesh_it_was() -> None:
    blob = shapes.bumpy_blob(2)
    found = cleaned(soup(blob))
    assert found.report["merged_vertices"] == 3 * len(blob.faces) - len(blob.vertices)
    assert (topology.edges(found.mesh.faces).count == 2).all()
    assert found.mesh.face_areas_mm2().sum() == pytest.approx(blob.face_areas_mm2().sum())


def test_first_occurrence_comes_first() -> None:
    mesh = soup(shapes.box())
    found = cleaned(mesh)
    assert (np.diff(found.old_of_new) > 0).all()


def test_cracks_of_rounding_are_welded_and_real_gaps_are_not() -> None:
    plane = shapes.grid_plane(4, 4)
    cut = soup(plane)
    rng = np.random.default_rng(0)
    trembling = Mesh(cut.vertices + rng.uniform(-1e-7, 1e-7, cut.vertices.shape), cut.faces)
    assert len(cleaned(trembling).mesh.vertices) == len(plane.vertices)
    gaping = Mesh(cut.vertices + rng.uniform(-1e-3, 1e-3, cut.vertices.shape), cut.faces)
    assert len(cleaned(gaping).mesh.vertices) == len(cut.vertices)


def test_degenerate_and_duplicate_faces_and_unused_vertices_go() -> None:
    box = shapes.box()
    extra = [[0, 0, 1], [0, 2, 3], [3, 0, 2]]  # a vertex twice; two copies of an existing face
    dirty = Mesh(np.concatenate([box.vertices, [[9.0, 9, 9]]]), np.concatenate([box.faces, extra]))
    report = cleaned(dirty).report
    assert (report["degenerate_faces"], report["duplicate_faces"], report["unused_vertices"]) == (1, 2, 1)
    assert report["faces"] == 12


def test_a_fin_on_an_edge_is_dropped() -> None:
    box = shapes.box((2.0, 2.0, 2.0))
    finned = Mesh(
        np.concatenate([box.vertices, [[1.0, -0.1, -0.1]]]), np.concatenate([box.faces, [[0, 1, 8]]])
    )
    found = cleaned(finned)
    assert found.report["non_manifold_faces"] == 1
    assert (topology.edges(found.mesh.faces).count == 2).all()


def test_inside_out_closed_mesh_is_turned() -> None:
    box = shapes.box()
    found = cleaned(Mesh(box.vertices, box.faces[:, ::-1]))
    assert found.report["turned_faces"] == 12
    np.testing.assert_array_less(
        0, np.einsum("nd,nd->n", found.mesh.vertex_normals(), found.mesh.vertices - 0.5)
    )


def together(*meshes: Mesh) -> Mesh:
    starts = np.cumsum([0, *(len(each.vertices) for each in meshes)])
    faces = [each.faces + start for each, start in zip(meshes, starts, strict=False)]
    return Mesh(np.concatenate([each.vertices for each in meshes]), np.concatenate(faces))


def turned_over(mesh: Mesh) -> Mesh:
    return Mesh(mesh.vertices, mesh.faces[:, ::-1])


def test_many_inside_out_pieces_are_turned_and_a_hollow_part_stays_hollow() -> None:
    apart = [
        Mesh(shapes.icosphere(1.0, 1).vertices + 5.0 * k, shapes.icosphere(1.0, 1).faces) for k in range(3)
    ]
    wrong = together(*map(turned_over, apart))
    assert cleaned(wrong).report["turned_faces"] == len(wrong.faces)
    hollow = together(shapes.icosphere(5.0, 2), turned_over(shapes.icosphere(2.0, 2)))
    assert cleaned(hollow).report["turned_faces"] == 0
    assert cleaned(turned_over(hollow)).report["turned_faces"] == len(hollow.faces)
    mixed = together(turned_over(shapes.icosphere(5.0, 2)), Mesh(apart[0].vertices + 20, apart[0].faces))
    assert cleaned(mixed).report["turned_faces"] == len(apart[0].faces) * 4  # around nothing: no cavity


def test_faces_that_disagree_are_turned_to_agree() -> None:
    blob = shapes.bumpy_blob(2)
    faces = blob.faces.copy()
    faces[::7] = faces[::7, ::-1]
    found = cleaned(Mesh(blob.vertices, faces))
    assert topology.is_coherent(found.mesh.faces)
    np.testing.assert_allclose(found.mesh.vertex_normals(), blob.vertex_normals(), atol=1e-12)


def test_small_pieces_go_when_asked() -> None:
    big, small = shapes.icosphere(5.0, 2), shapes.icosphere(0.2, 1)
    both = Mesh(
        np.concatenate([big.vertices, small.vertices + 20]),
        np.concatenate([big.faces, small.faces + len(big.vertices)]),
    )
    assert cleaned(both).report["small_components"] == 0
    found = cleaned(both, min_component_share=0.01)
    assert found.report["small_components"] == 1
    assert len(found.mesh.vertices) == len(big.vertices)


def test_points_are_kept_as_points_without_copies() -> None:
    points = np.random.default_rng(0).random((50, 3))
    found = cleaned(Mesh(np.concatenate([points, points[:10]])))
    assert found.mesh.is_cloud and len(found.mesh.vertices) == 50 and found.report["merged_vertices"] == 10


@pytest.mark.parametrize(
    ("mesh", "error"),
    [
        (Mesh(np.eye(3), np.array([[0, 1, 2]])), errors.DegenerateMesh),
        (
            Mesh(np.linspace(0, 1, 30)[:, None] * np.ones(3), np.arange(30).reshape(-1, 3)),
            errors.DegenerateMesh,
        ),
        (Mesh(np.zeros((12, 3)), np.arange(12).reshape(-1, 3)), errors.DegenerateMesh),
        (Mesh(np.random.default_rng(0).random((29, 3))), errors.TooFewPoints),
        (Mesh(np.zeros((40, 3))), errors.TooFewPoints),
    ],
    ids=["one triangle", "all on a line", "all in a point", "29 points", "40 copies of a point"],
)
def test_nothing_usable_is_a_clear_error(mesh: Mesh, error: type[Exception]) -> None:
    with pytest.raises(error, match="scan: "):
        clean(mesh, "scan", CleanSettings())


def test_group_rows_is_an_index_and_its_inverse() -> None:
    rows = np.random.default_rng(0).integers(0, 3, (200, 2))
    first, group = group_rows(rows)
    np.testing.assert_array_equal(rows[first][group], rows)
    assert len(first) == len({tuple(row) for row in rows.tolist()})
    assert (np.diff(first) > 0).all()
    assert all((rows[:k] != rows[k]).any(axis=1).all() for k in first)
