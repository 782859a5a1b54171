"""Exact geodesics: unfolded closed forms, properties, a reference implementation, and any mesh whatever."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pygeodesic import geodesic as pygeodesic

from pipeline.core.mesh import Mesh
from pipeline.kernels.geodesics import GeodesicSolver, edge_lengths
from pipeline.kernels.sampling import farthest
from tests.support import shapes
from tests.support.geodesics import rough_blob, solver_of


@pytest.fixture(scope="module")
def rough() -> Mesh:
    return rough_blob()


# --- closed forms


def test_on_a_plane_it_is_the_straight_line() -> None:
    rng = np.random.default_rng(0)
    plane = shapes.grid_plane(15, 11)
    inner = (plane.vertices[:, 0] % 14 > 0) & (plane.vertices[:, 1] % 10 > 0)
    shaken = plane.vertices + np.where(
        inner[:, None], rng.uniform(-0.3, 0.3, plane.vertices.shape) * [1, 1, 0], 0.0
    )
    for vertices in (plane.vertices, shaken):  # the even grid has whole rows of vertices on straight lines
        found = solver_of(Mesh(vertices, plane.faces)).distances([0, 60, 100])
        expected = np.linalg.norm(vertices[None] - vertices[[0, 60, 100]][:, None], axis=2)
        np.testing.assert_allclose(found, expected, rtol=1e-12, atol=1e-12)


def test_around_an_l_shaped_plane_it_bends_at_the_corner() -> None:
    plane = shapes.grid_plane(9, 9)
    centre = plane.vertices[plane.faces].mean(axis=1)
    mesh = Mesh(plane.vertices, plane.faces[~((centre[:, 0] > 4) & (centre[:, 1] > 4))])
    a, b, corner = 3 * 9 + 8, 8 * 9 + 3, 4 * 9 + 4  # (3, 8), (8, 3), (4, 4)
    expected = 2 * np.linalg.norm(plane.vertices[a] - plane.vertices[corner])
    assert solver_of(mesh).distances(a)[b] == pytest.approx(expected, rel=1e-12)


def test_on_a_cube_it_is_the_shortest_unfolding() -> None:
    cube = shapes.box((1.0, 1.0, 1.0), 3)
    solver = solver_of(cube)
    at = {tuple(v): i for i, v in enumerate(np.round(cube.vertices * 8).astype(int).tolist())}
    assert solver.distances(at[0, 0, 0])[at[8, 8, 8]] == pytest.approx(np.sqrt(5), rel=1e-12)
    # from the middle of a face to the middle of the opposite one, and to a corner of it
    assert solver.distances(at[4, 4, 0])[at[4, 4, 8]] == pytest.approx(2.0, rel=1e-12)
    assert solver.distances(at[4, 4, 0])[at[8, 8, 8]] == pytest.approx(np.hypot(1.5, 0.5), rel=1e-12)


def test_on_a_cylinder_of_n_sides_it_is_the_unrolled_line() -> None:
    around, along, height = 24, 9, 8.0
    tube = shapes.cylinder(2.0, height, around, along)
    side = np.linalg.norm(tube.vertices[0] - tube.vertices[along])
    distances = solver_of(tube).distances(0)
    steps, z = np.divmod(np.arange(around * along), along)
    steps = np.minimum(steps, around - steps)
    expected = np.hypot(steps * side, z * height / (along - 1))
    np.testing.assert_allclose(distances, expected, rtol=1e-12, atol=1e-12)


@pytest.mark.parametrize("turn", [1.0, 2.5, 4.0], ids="{} rad".format)
def test_on_a_cone_it_is_the_line_in_the_unrolled_sector(turn: float) -> None:
    """A sector of angle `turn` rolled into a cone of flat faces: the far side is nearer than over the rim."""
    sides = 40
    angle = turn * np.arange(sides) / sides
    radii = np.array([1.0, 2.0, 3.0])
    chord = 2 * np.sin(turn / sides / 2)
    lean = chord / (2 * np.sin(np.pi / sides))  # radius of the rolled rim over its distance from the apex
    phi = 2 * np.pi * np.arange(sides) / sides
    rings = [
        np.stack(
            [r * lean * np.cos(phi), r * lean * np.sin(phi), np.full(sides, -r * np.sqrt(1 - lean**2))], 1
        )
        for r in radii
    ]
    vertices = np.concatenate([np.zeros((1, 3)), *rings])
    i, j = np.arange(sides), (np.arange(sides) + 1) % sides
    faces = [np.stack([np.zeros(sides, int), 1 + i, 1 + j], 1)]
    for ring in range(2):
        a, b = 1 + ring * sides, 1 + (ring + 1) * sides
        faces += [np.stack([a + i, b + i, b + j], 1), np.stack([a + i, b + j, a + j], 1)]
    distances = solver_of(Mesh(vertices, np.concatenate(faces))).distances(
        1 + 2 * sides
    )  # on the rim, at angle 0
    for ring, r in enumerate(radii[:2]):
        opening = np.minimum(angle, turn - angle)
        straight = np.sqrt(9 + r * r - 6 * r * np.cos(opening))
        found = distances[1 + ring * sides : 1 + (ring + 1) * sides]
        np.testing.assert_allclose(found[1:], np.where(opening < np.pi, straight, 3 + r)[1:], rtol=1e-9)


def test_subdivision_of_flat_faces_changes_nothing_between_old_vertices() -> None:
    solid = shapes.icosphere(2.0, 1)
    fine = shapes.subdivided(shapes.subdivided(solid))
    n = len(solid.vertices)
    coarse_rows = solver_of(solid).distances(np.arange(n))
    np.testing.assert_allclose(
        solver_of(fine).distances(np.arange(n))[:, :n], coarse_rows, rtol=1e-12, atol=1e-12
    )


# --- a reference implementation


@pytest.mark.parametrize("holes", [0, 1, 12])
def test_agrees_with_pygeodesic_on_rough_meshes_with_saddles_and_borders(rough: Mesh, holes: int) -> None:
    """Holes, not bow ties: the reference does not pass through a vertex that only joins two fans."""
    pierced = farthest(rough.vertices, holes)
    mesh = Mesh(rough.vertices, rough.faces[~np.isin(rough.faces, pierced).any(axis=1)])
    used = np.unique(mesh.faces)
    mesh = Mesh(mesh.vertices[used], np.searchsorted(used, mesh.faces))
    reference = pygeodesic.PyGeodesicAlgorithmExact(np.array(mesh.vertices), np.array(mesh.faces))
    solver = solver_of(mesh)
    for source in (0, 100, 333):
        expected, _ = reference.geodesicDistances(np.array([source]), None)
        found = solver.distances(source)
        reached = expected < 1e10
        np.testing.assert_array_equal(np.isfinite(found), reached)
        np.testing.assert_allclose(found[reached], expected[reached], rtol=1e-9)


# --- properties


def test_symmetry_and_triangle_inequality(rough: Mesh) -> None:
    rows = solver_of(rough).distances(np.arange(len(rough.vertices)))
    np.testing.assert_allclose(rows, rows.T, rtol=1e-9)
    rng = np.random.default_rng(0)
    i, j, k = rng.integers(0, len(rows), (3, 4000))
    assert (rows[i, k] <= (rows[i, j] + rows[j, k]) * (1 + 1e-12)).all()
    assert (
        rows >= np.linalg.norm(rough.vertices[:, None] - rough.vertices[None], axis=2) * (1 - 1e-12)
    ).all()


def test_a_bounded_search_is_the_full_one_inside_the_radius(rough: Mesh) -> None:
    solver = solver_of(rough)
    full, bounded = solver.distances(5), solver.distances(5, radius=9.0)
    np.testing.assert_array_equal(bounded, np.where(full <= 9.0, full, np.inf))


def test_intrinsic_lengths_alone_decide() -> None:
    """A sheet rolled into a quarter tube has the same lengths, hence the same distances, as the flat one."""
    plane = shapes.grid_plane(12, 9)
    other = np.random.default_rng(0).normal(size=plane.vertices.shape)
    rolled = GeodesicSolver(other, plane.faces, lengths=edge_lengths(plane.vertices, plane.faces))
    np.testing.assert_array_equal(rolled.distances(3), solver_of(plane).distances(3))


def test_threads_do_not_change_one_bit(rough: Mesh) -> None:
    one, many = solver_of(rough, threads=1), solver_of(rough, threads=5)
    weights = rough.vertex_areas_mm2()
    assert one.distances([1, 2, 3]).tobytes() == many.distances([1, 2, 3]).tobytes()
    assert one.quantile(0.03) == many.quantile(0.03)
    assert one.density(7.0, weights).tobytes() == many.density(7.0, weights).tobytes()
    assert one.within(6.0).data.tobytes() == many.within(6.0).data.tobytes()
    for a, b in zip(one.nearest_denser(weights), many.nearest_denser(weights), strict=True):
        assert a.tobytes() == b.tobytes()


# --- whatever comes


@settings(max_examples=150, deadline=None)
@given(data=st.data())
def test_any_mesh_gives_distances_and_never_a_crash(data: st.DataObject) -> None:
    """Repeated and reversed faces, faces that name a vertex twice, edges of many faces, needles, vertices
    in one place.
    """
    n = data.draw(st.integers(1, 12))
    extreme = data.draw(st.booleans())
    coordinate = st.sampled_from([0.0, 1.0, 2.0, 0.5, 1 / 3, *([1e-9, 1e6] if extreme else [1e-3, 50.0])])
    vertices = np.array(
        data.draw(st.lists(st.tuples(coordinate, coordinate, coordinate), min_size=n, max_size=n))
    )
    corner = st.integers(0, n - 1)
    faces = data.draw(st.lists(st.tuples(corner, corner, corner), max_size=20))
    mesh = Mesh(vertices, np.array(faces, dtype=np.int32).reshape(-1, 3))
    solver = solver_of(mesh, threads=1)
    rows = solver.distances(np.arange(n))
    assert (np.diagonal(rows) == 0).all() and not np.isnan(rows).any()
    straight = np.linalg.norm(vertices[:, None] - vertices[None], axis=2)
    scale = 1e-9 * straight.max()
    assert (rows >= straight - scale).all()
    same = [face for face in faces if len(set(face)) == 3]
    for a, b, c in same:  # no farther than along the edges
        for i, j in ((a, b), (b, c), (c, a)):
            assert rows[i, j] <= straight[i, j] + scale
    matrix = np.minimum(rows, rows.T)
    pairs = np.sort(matrix[np.triu_indices(n, 1)])
    if n > 1 and extreme:
        assert solver.quantile(0.3) >= 0
    elif n > 1:
        assert solver.quantile(0.3) == pytest.approx(pairs[max(1, round(0.3 * len(pairs))) - 1], rel=1e-9)
    index, _ = solver.nearest_denser(np.arange(n, dtype=np.float64))
    assert ((index > np.arange(n)) | (index == -1)).all()


def test_a_source_that_is_no_vertex_is_refused() -> None:
    with pytest.raises(IndexError):
        solver_of(shapes.box()).distances(8)


def test_progress_is_heard_and_false_stops_the_work() -> None:
    mesh = shapes.bumpy_blob(4)
    heard: list[float] = []
    GeodesicSolver(mesh.vertices, mesh.faces, threads=1, on_share=heard.append).distances(np.arange(400))
    assert heard == sorted(heard) and len(heard) > 0 and heard[-1] <= 1
    refusing = GeodesicSolver(mesh.vertices, mesh.faces, threads=1, on_share=lambda _: False)
    with pytest.raises(InterruptedError):
        refusing.distances(np.arange(2000))
