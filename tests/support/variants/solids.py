"""Closed solids by formula, and their exact union and difference (libigl, through pymeshlab)."""

from math import acos, ceil, pi

import numpy as np
import pymeshlab

from pipeline.core.mesh import FloatArray, IndexArray, Mesh

#: Distance of a chord from its arc, mm: a usual setting of STL export. Finer circles make booleans slow.
CHORD_MM = 0.05
#: Sides of a circle, at least: an inscribed polygon of 32 sides has 99.4 % of the area of its circle.
MIN_SIDES = 32
#: Vertices of a boolean nearer than this, mm, are one: the exact intersections were rounded to doubles.
WELD_MM = 1e-6


def sides_of(radius_mm: float) -> int:
    """Sides of the polygon for a circle: a multiple of 4, its chords within CHORD_MM."""
    exact = pi / acos(1 - min(CHORD_MM / radius_mm, 0.5))
    return max(MIN_SIDES, 4 * ceil(exact / 4))


def circle(centre_mm: tuple[float, float], radius_mm: float) -> FloatArray:
    """(n, 2) corners of the inscribed polygon, counter-clockwise."""
    n = sides_of(radius_mm)
    angle = (np.arange(n) + 0.5) * 2 * pi / n
    return np.array(centre_mm) + radius_mm * np.stack([np.cos(angle), np.sin(angle)], axis=1)


def hexagon(across_flats_mm: float) -> FloatArray:
    """(6, 2) corners of a regular hexagon about the origin, counter-clockwise."""
    angle = np.arange(6) * pi / 3
    return across_flats_mm / 3**0.5 * np.stack([np.cos(angle), np.sin(angle)], axis=1)


def rounded_rectangle(
    low_mm: tuple[float, float],
    high_mm: tuple[float, float],
    radii_mm: tuple[float, float, float, float],
    chords: int = 6,
) -> FloatArray:
    """(n, 2) corners, counter-clockwise; radii of the corners at (high, high), (low, high), (low, low),
    (high, low), each rounded by so many chords; 0 leaves a corner sharp.
    """
    (x0, y0), (x1, y1) = low_mm, high_mm
    corners, inwards = [(x1, y1), (x0, y1), (x0, y0), (x1, y0)], [(-1, -1), (1, -1), (1, 1), (-1, 1)]
    outline = []
    for number, radius in enumerate(radii_mm):
        angle = (np.linspace(0, 1, chords + 1) + number) * pi / 2
        arc = np.array(inwards[number]) + np.stack([np.cos(angle), np.sin(angle)], axis=1)
        outline.append(corners[number] + radius * (arc if radius > 0 else arc[:1]))
    return np.concatenate(outline)


def slot(from_mm: tuple[float, float], to_mm: tuple[float, float], radius_mm: float) -> FloatArray:
    """(n, 2) corners of an obround hole between two centres, counter-clockwise."""
    start, end = np.array(from_mm), np.array(to_mm)
    direction = np.arctan2(*(end - start)[::-1])
    half = np.linspace(-pi / 2, pi / 2, sides_of(radius_mm) // 2 + 1) + direction
    arc = radius_mm * np.stack([np.cos(half), np.sin(half)], axis=1)
    return np.concatenate([end + arc, start - arc])


def block(low_mm: tuple[float, float, float], high_mm: tuple[float, float, float]) -> Mesh:
    """A box between two corners."""
    (x0, y0, z0), (x1, y1, z1) = low_mm, high_mm
    return prism(np.array([[x0, y0], [x1, y0], [x1, y1], [x0, y1]]), z0, z1)


def prism(outline_mm: FloatArray, low_mm: float, high_mm: float) -> Mesh:
    """The outline (n, 2), counter-clockwise and seen whole from its first corner, raised along z."""
    n = len(outline_mm)
    vertices = np.concatenate([np.column_stack([outline_mm, np.full(n, z)]) for z in (low_mm, high_mm)])
    fan = np.stack([np.zeros(n - 2, dtype=np.int64), np.arange(1, n - 1), np.arange(2, n)], axis=1)
    return Mesh(vertices, np.concatenate([_band(n, 0, n), fan[:, ::-1], fan + n]))


def cylinder(centre_mm: tuple[float, float], radius_mm: float, low_mm: float, high_mm: float) -> Mesh:
    """A cylinder along z."""
    return prism(circle(centre_mm, radius_mm), low_mm, high_mm)


def cup(outer_mm: FloatArray, inner_mm: FloatArray, bottom_mm: float, floor_mm: float, rim_mm: float) -> Mesh:
    """An open container: walls between two convex outlines of equally many corners, and a floor."""
    n = len(outer_mm)
    rings = [(outer_mm, bottom_mm), (outer_mm, rim_mm), (inner_mm, rim_mm), (inner_mm, floor_mm)]
    vertices = np.concatenate([np.column_stack([ring, np.full(n, z)]) for ring, z in rings])
    fan = np.stack([np.zeros(n - 2, dtype=np.int64), np.arange(1, n - 1), np.arange(2, n)], axis=1)
    bands = [_band(n, k * n, (k + 1) * n) for k in range(3)]
    return Mesh(vertices, np.concatenate([*bands, fan[:, ::-1], fan + 3 * n]))


def revolved(profile_mm: FloatArray) -> Mesh:
    """The closed profile (k, 2) of (radius > 0, z), counter-clockwise, turned about z: a ring."""
    k, n = len(profile_mm), sides_of(float(profile_mm[:, 0].max()))
    angle = (np.arange(n) + 0.5) * 2 * pi / n
    radius, z = profile_mm[:, :1], profile_mm[:, 1:]
    rings = [radius * np.cos(angle), radius * np.sin(angle), np.repeat(z, n, axis=1)]
    bands = [_band(n, i * n, (i + 1) % k * n) for i in range(k)]
    return Mesh(np.stack(rings, axis=2).reshape(-1, 3), np.concatenate(bands))


def stacked(profile_mm: FloatArray) -> Mesh:
    """The profile (k, 2) of (radius > 0, z), z upwards, turned about z, closed by discs: a solid."""
    k, n = len(profile_mm), sides_of(float(profile_mm[:, 0].max()))
    angle = (np.arange(n) + 0.5) * 2 * pi / n
    radius, z = profile_mm[:, :1], profile_mm[:, 1:]
    rings = [radius * np.cos(angle), radius * np.sin(angle), np.repeat(z, n, axis=1)]
    fan = np.stack([np.zeros(n - 2, dtype=np.int64), np.arange(1, n - 1), np.arange(2, n)], axis=1)
    bands = [_band(n, i * n, (i + 1) * n) for i in range(k - 1)]
    faces = np.concatenate([*bands, fan[:, ::-1], fan + (k - 1) * n])
    return Mesh(np.stack(rings, axis=2).reshape(-1, 3), faces)


def prism_along_y(outline_xz_mm: FloatArray, low_mm: float, high_mm: float) -> Mesh:
    """As `prism`, of an outline (n, 2) in (x, z), counter-clockwise with z upwards, raised along y."""
    order = np.concatenate([[0], np.arange(len(outline_xz_mm) - 1, 0, -1)])
    return z_to_y(prism(outline_xz_mm[order, ::-1], low_mm, high_mm))


def z_to_x(mesh: Mesh) -> Mesh:
    """Turned so that what lay along (x, y, z) lies along (y, z, x)."""
    return Mesh(mesh.vertices[:, [2, 0, 1]], mesh.faces)


def z_to_y(mesh: Mesh) -> Mesh:
    """Turned so that what lay along (x, y, z) lies along (z, x, y)."""
    return Mesh(mesh.vertices[:, [1, 2, 0]], mesh.faces)


def joined(*meshes: Mesh) -> Mesh:
    """All meshes as one, each with its own vertices; bodies may overlap."""
    offsets = np.cumsum([0, *(len(mesh.vertices) for mesh in meshes[:-1])])
    return Mesh(
        np.concatenate([mesh.vertices for mesh in meshes]),
        np.concatenate([mesh.faces + offset for mesh, offset in zip(meshes, offsets, strict=True)]),
    )


def carved(solids: list[Mesh], cuts: list[Mesh]) -> Mesh:
    """The union of the closed `solids`, less the union of the closed `cuts` (at least one of them)."""
    meshes = pymeshlab.MeshSet(verbose=False)
    for mesh in (joined(*solids), joined(*cuts)):
        meshes.add_mesh(pymeshlab.Mesh(mesh.vertices, mesh.faces))
    meshes.generate_boolean_difference(first_mesh=0, second_mesh=1)
    current = meshes.current_mesh()
    return _welded(np.array(current.vertex_matrix()), np.array(current.face_matrix(), dtype=np.int64))


def volume_mm3(mesh: Mesh) -> float:
    """Volume within a closed mesh; negative when it is inside out."""
    corners = mesh.vertices[mesh.faces] - mesh.vertices.mean(axis=0)
    return float(np.linalg.det(corners).sum() / 6)


def is_closed(mesh: Mesh) -> bool:
    """Whether every edge is met by as many triangles in one direction as in the other."""
    faces = mesh.faces.astype(np.int64)
    start, end = faces.ravel(), np.roll(faces, -1, axis=1).ravel()
    n = len(mesh.vertices)
    forward, backward = np.sort(start * n + end), np.sort(end * n + start)
    return bool((forward == backward).all())


def _band(n: int, first: int, second: int) -> IndexArray:
    """Two triangles for each pair of corners between the rings of n vertices from `first` and `second`."""
    i = np.arange(n)
    j = (i + 1) % n
    lower = np.stack([first + i, first + j, second + j], axis=1)
    return np.concatenate([lower, np.stack([first + i, second + j, second + i], axis=1)])


def _welded(vertices: FloatArray, faces: IndexArray) -> Mesh:
    """Vertices at the same place within WELD_MM made one; triangles that this leaves without area dropped.

    The boolean gives the same triangles every time, but not in the same order: they are sorted.
    """
    _, first, number = np.unique(
        np.round(vertices / WELD_MM).astype(np.int64), axis=0, return_index=True, return_inverse=True
    )
    faces = number.reshape(-1)[faces]
    flat = (faces == np.roll(faces, 1, axis=1)).any(axis=1)
    faces = faces[~flat]
    turn = (faces.argmin(axis=1)[:, None] + np.arange(3)) % 3  # the smallest index first
    faces = np.take_along_axis(faces, turn, axis=1)
    return Mesh(vertices[first], faces[np.lexsort(faces.T[::-1])].astype(np.int32))
