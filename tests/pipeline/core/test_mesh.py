"""A mesh owns its arrays: nobody can change them, and large ones are not copied for that."""

import numpy as np
import pytest

from pipeline.core.errors import IndexOutOfRange, NotFinite
from pipeline.core.mesh import Mesh, frozen
from tests.support import shapes

BOX = shapes.box()


def test_what_the_caller_can_write_to_is_copied() -> None:
    vertices, faces = BOX.vertices.copy(), BOX.faces.copy()
    mesh = Mesh(vertices, faces)
    vertices[:], faces[:] = 9.0, 0
    np.testing.assert_array_equal(mesh.vertices, BOX.vertices)
    np.testing.assert_array_equal(mesh.faces, BOX.faces)


def test_a_view_of_what_the_caller_can_write_to_is_copied() -> None:
    owner = BOX.vertices.copy()
    view = owner[:]
    view.flags.writeable = False
    mesh = Mesh(view, BOX.faces)
    owner[:] = 9.0
    np.testing.assert_array_equal(mesh.vertices, BOX.vertices)


def test_frozen_arrays_are_taken_as_they_are() -> None:
    owner = BOX.vertices.ravel().copy()
    vertices, faces = frozen(owner.reshape(-1, 3)), frozen(BOX.faces.copy())
    mesh = Mesh(vertices, faces)
    assert np.shares_memory(mesh.vertices, owner) and np.shares_memory(mesh.faces, faces)
    assert not owner.flags.writeable


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
def test_a_vertex_that_is_not_finite_is_named(bad: float) -> None:
    vertices = BOX.vertices.copy()
    vertices[5, 1] = bad
    with pytest.raises(NotFinite, match=r"1 of 8 vertices .* index 5"):
        Mesh(vertices, BOX.faces)


def test_a_face_beyond_the_vertices_is_named() -> None:
    faces = BOX.faces.copy()
    faces[3, 2] = 8
    with pytest.raises(IndexOutOfRange, match="triangle 3"):
        Mesh(BOX.vertices, faces)
