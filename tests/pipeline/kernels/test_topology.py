import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from pipeline.core.mesh import IntArray
from pipeline.kernels.topology import edges
from tests.support import shapes

CORNERS = st.integers(0, 9)
FACES = st.integers(0, 30).flatmap(lambda m: arrays(np.int32, (m, 3), elements=CORNERS))


@given(FACES)
def test_the_edges_are_the_sorted_pairs_of_corners(faces: IntArray) -> None:
    pairs = np.sort(np.stack([faces[:, [1, 2]], faces[:, [2, 0]], faces[:, [0, 1]]], axis=1), axis=2)
    ends, of_face, count = np.unique(pairs.reshape(-1, 2), axis=0, return_inverse=True, return_counts=True)
    found = edges(faces)
    np.testing.assert_array_equal(found.ends, ends)
    np.testing.assert_array_equal(found.of_face, of_face.reshape(-1, 3))
    np.testing.assert_array_equal(found.count, count)


def test_a_closed_mesh_has_the_edges_of_eulers_formula() -> None:
    ball = shapes.icosphere(1.0, 3)
    found = edges(ball.faces)
    assert len(ball.vertices) - len(found.ends) + len(ball.faces) == 2
    assert (found.count == 2).all()
