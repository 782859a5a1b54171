"""Shapes by formula, so that tests read as geometry and need no files."""

import numpy as np

from pipeline.core.mesh import FloatArray, Mesh


def grid_plane(nx: int = 12, ny: int = 9, step_mm: float = 1.0) -> Mesh:
    """A flat rectangle in z = 0, facing +z, (nx - 1) * step by (ny - 1) * step."""
    x, y = np.meshgrid(np.arange(nx) * step_mm, np.arange(ny) * step_mm, indexing="ij")
    vertices = np.stack([x.ravel(), y.ravel(), np.zeros(nx * ny)], axis=1)
    corner = (np.arange(nx - 1)[:, None] * ny + np.arange(ny - 1)).ravel()
    right, up, across = corner + ny, corner + 1, corner + ny + 1
    return Mesh(
        vertices, np.concatenate([np.stack([corner, right, across], 1), np.stack([corner, across, up], 1)])
    )


def icosphere(radius_mm: float = 1.0, levels: int = 3) -> Mesh:
    """A sphere of nearly equal triangles, 10 * 4^levels + 2 vertices."""
    g = (1 + 5**0.5) / 2
    corners = [(-1, g, 0), (1, g, 0), (-1, -g, 0), (1, -g, 0), (0, -1, g), (0, 1, g)]
    corners += [(0, -1, -g), (0, 1, -g), (g, 0, -1), (g, 0, 1), (-g, 0, -1), (-g, 0, 1)]
    around_0 = [(0, 11, 5), (0, 5, 1), (0, 1, 7), (0, 7, 10), (0, 10, 11)]
    beside = [(1, 5, 9), (5, 11, 4), (11, 10, 2), (10, 7, 6), (7, 1, 8)]
    around_3 = [(3, 9, 4), (3, 4, 2), (3, 2, 6), (3, 6, 8), (3, 8, 9)]
    rest = [(4, 9, 5), (2, 4, 11), (6, 2, 10), (8, 6, 7), (9, 8, 1)]
    mesh = Mesh(np.array(corners, dtype=np.float64), np.array(around_0 + beside + around_3 + rest))
    for _ in range(levels):
        mesh = subdivided(mesh)
    unit = mesh.vertices / np.linalg.norm(mesh.vertices, axis=1, keepdims=True)
    return Mesh(radius_mm * unit, mesh.faces)


def subdivided(mesh: Mesh) -> Mesh:
    """Every triangle cut in four at the middles of its edges; old vertices keep their numbers."""
    faces = mesh.faces.astype(np.int64)
    ends = np.sort(np.concatenate([faces[:, [1, 2]], faces[:, [2, 0]], faces[:, [0, 1]]]), axis=1)
    unique, inverse = np.unique(ends, axis=0, return_inverse=True)
    a, b, c = inverse.reshape(3, -1) + len(mesh.vertices)
    i, j, k = faces.T
    middles = mesh.vertices[unique].mean(axis=1)
    cut = [np.stack(t, axis=1) for t in ((i, c, b), (c, j, a), (b, a, k), (a, b, c))]
    return Mesh(np.concatenate([mesh.vertices, middles]), np.concatenate(cut))


def box(size_mm: tuple[float, float, float] = (1.0, 1.0, 1.0), levels: int = 0) -> Mesh:
    """A closed box from the origin to `size_mm`, normals out."""
    x = np.array([[i & 1, i >> 1 & 1, i >> 2 & 1] for i in range(8)], dtype=np.float64) * size_mm
    quads = [(0, 2, 3, 1), (4, 5, 7, 6), (0, 1, 5, 4), (2, 6, 7, 3), (0, 4, 6, 2), (1, 3, 7, 5)]
    faces = [t for a, b, c, d in quads for t in ((a, b, c), (a, c, d))]
    mesh = Mesh(x, np.array(faces))
    for _ in range(levels):
        mesh = subdivided(mesh)
    return mesh


def cylinder(radius_mm: float = 2.0, height_mm: float = 8.0, around: int = 64, along: int = 33) -> Mesh:
    """An open tube about z, normals out."""
    angle, z = np.meshgrid(
        np.arange(around) * 2 * np.pi / around, np.linspace(0, height_mm, along), indexing="ij"
    )
    vertices = np.stack([radius_mm * np.cos(angle), radius_mm * np.sin(angle), z], axis=-1).reshape(-1, 3)
    i, k = np.meshgrid(np.arange(around), np.arange(along - 1), indexing="ij")
    corner, right = (i * along + k).ravel(), ((i + 1) % around * along + k).ravel()
    return Mesh(
        vertices,
        np.concatenate(
            [np.stack([corner, right, right + 1], 1), np.stack([corner, right + 1, corner + 1], 1)]
        ),
    )


def torus(major_mm: float = 5.0, minor_mm: float = 2.0, around: int = 96, across: int = 48) -> Mesh:
    u, v = np.meshgrid(
        np.arange(around) * 2 * np.pi / around, np.arange(across) * 2 * np.pi / across, indexing="ij"
    )
    ring = major_mm + minor_mm * np.cos(v)
    vertices = np.stack([ring * np.cos(u), ring * np.sin(u), minor_mm * np.sin(v)], axis=-1).reshape(-1, 3)
    i, j = np.meshgrid(np.arange(around), np.arange(across), indexing="ij")
    a, b = (i * across + j).ravel(), ((i + 1) % around * across + j).ravel()
    c, d = ((i + 1) % around * across + (j + 1) % across).ravel(), (i * across + (j + 1) % across).ravel()
    return Mesh(vertices, np.concatenate([np.stack([a, b, c], 1), np.stack([a, c, d], 1)]))


def bumpy_blob(levels: int = 4, radius_mm: float = 20.0, triangulation: int | None = None) -> Mesh:
    """A closed part without any symmetry: an ellipsoid with bumps of several sizes, ~20 mm.

    Every `triangulation` samples the same surface at other points.
    """
    sphere = icosphere(1.0, levels)
    n = sphere.vertices if triangulation is None else sphere.vertices @ motion(triangulation)[:3, :3].T
    bumps = [((1, 0.2, 0.1), 0.30, 0.35), ((-0.3, 1, 0.4), 0.22, 0.30), ((0.2, -0.5, 1), 0.26, 0.40)]
    bumps += [((-1, -0.6, 0.3), 0.18, 0.25), ((0.5, 0.5, -1), -0.15, 0.35), ((-0.4, 0.3, -0.9), 0.24, 0.28)]
    height = np.ones(len(n))
    for centre, size, width in bumps:
        direction = np.array(centre) / np.linalg.norm(centre)
        height += size * np.exp(-((1 - n @ direction) / width**2) * 2)
    return Mesh(radius_mm * height[:, None] * n * [1.0, 0.8, 0.65], sphere.faces)


def motion(seed: int, translation_mm: float = 50.0) -> FloatArray:
    """A random rigid motion, any rotation."""
    rng = np.random.default_rng(seed)
    q, r = np.linalg.qr(rng.normal(size=(3, 3)))
    q *= np.sign(np.diag(r))
    q[:, 0] *= np.linalg.det(q)
    T = np.eye(4)
    T[:3, :3], T[:3, 3] = q, rng.uniform(-translation_mm, translation_mm, 3)
    return T


def beads(
    radius_mm: float = 5.0, pitch_mm: float = 12.0, count: int = 3, around: int = 40, along: int = 121
) -> Mesh:
    """A closed solid of revolution about x: `count` spheres on a thin rod, the middle of the first at the
    origin.
    """
    x = np.linspace(-radius_mm, (count - 1) * pitch_mm + radius_mm, along)[1:-1]
    from_middle = x - pitch_mm * np.clip(np.round(x / pitch_mm), 0, count - 1)
    profile = np.sqrt(np.maximum(radius_mm**2 - from_middle**2, (0.15 * radius_mm) ** 2))
    angle = np.arange(around) * 2 * np.pi / around
    rings = np.stack(
        [
            np.repeat(x, around),
            np.outer(profile, np.cos(angle)).ravel(),
            np.outer(profile, np.sin(angle)).ravel(),
        ],
        1,
    )
    ends = np.array([[-radius_mm, 0, 0], [(count - 1) * pitch_mm + radius_mm, 0, 0]])
    i, k = np.meshgrid(np.arange(len(x) - 1), np.arange(around), indexing="ij")
    a, b = (i * around + k).ravel(), (i * around + (k + 1) % around).ravel()
    sides = [np.stack([a, b, b + around], 1), np.stack([a, b + around, a + around], 1)]
    k, after, last = np.arange(around), (np.arange(around) + 1) % around, (len(x) - 1) * around
    first_cap = np.stack([np.full(around, len(rings)), after, k], 1)
    last_cap = np.stack([np.full(around, len(rings) + 1), last + k, last + after], 1)
    return Mesh(np.concatenate([rings, ends]), np.concatenate([*sides, first_cap, last_cap]))


def gear(teeth: int = 60, radius_mm: float = 20.0) -> Mesh:
    """A closed ring about z with low teeth all round and a key at angle 0, higher above than below: one pose
    only, and nearly as good a one for every tooth that it is turned by, either side up.
    """
    ring = torus(radius_mm, radius_mm / 4, around=8 * teeth, across=48)
    angle = np.arctan2(ring.vertices[:, 1], ring.vertices[:, 0])
    middle = radius_mm * np.stack([np.cos(angle), np.sin(angle), np.zeros_like(angle)], axis=1)
    off = ring.vertices - middle
    above = 1.0 + 0.5 * np.clip(8.0 * off[:, 2] / radius_mm, -1.0, 1.0)
    key = 0.25 * np.exp(-((angle / 0.15) ** 2)) * above
    return Mesh(middle + off * (1.0 + 0.08 * np.cos(teeth * angle) + key)[:, None], ring.faces)


def rack(teeth: int = 30, pitch_mm: float = 3.0, height_mm: float = 0.8, width_mm: float = 12.0) -> Mesh:
    """A closed toothed bar along x, teeth on top, with a higher block over the last three pitches: one pose
    only, and nearly as good a one for every tooth that it is moved by.
    """
    x = np.linspace(0.0, teeth * pitch_mm, 16 * teeth + 1)
    at_block = np.clip((x - (teeth - 3) * pitch_mm) / (0.3 * pitch_mm), 0.0, 1.0)
    top = 8.0 + height_mm * np.sin(2 * np.pi * x / pitch_mm) * (1 - at_block) + 4.0 * at_block
    floor = np.zeros_like(x)
    across = np.linspace(0.0, width_mm, 13)
    loop = [np.stack([x, np.full_like(x, y), floor], 1) for y in across]
    loop += [np.stack([x, np.full_like(x, y), top * share], 1) for y, share in [(width_mm, 0.5)]]
    loop += [np.stack([x, np.full_like(x, y), top], 1) for y in across[::-1]]
    loop += [np.stack([x, floor, 0.5 * top], 1)]
    n, m = len(x), len(loop)
    vertices = np.stack(loop, axis=1).reshape(-1, 3)
    i, k = (q.ravel() for q in np.meshgrid(np.arange(n - 1), np.arange(m), indexing="ij"))
    a, b, c, d = i * m + k, i * m + (k + 1) % m, (i + 1) * m + (k + 1) % m, (i + 1) * m + k
    sides = np.concatenate([np.stack([a, c, d], 1), np.stack([a, b, c], 1)])
    ends, middles = [], []
    for number, (first, turn) in enumerate([(0, -1), ((n - 1) * m, 1)]):
        ring = first + np.arange(m)
        middles.append(vertices[ring].mean(axis=0))
        hub = np.full(m, n * m + number)
        ends.append(np.stack([hub, ring, np.roll(ring, -1)][::turn], 1))
    return Mesh(np.concatenate([vertices, middles]), np.concatenate([sides, *ends]))


def cross(arms: int, lift_mm: float = 0.0) -> Mesh:
    """A disc of revolution with `arms` equal lobes about z; `lift_mm` makes one of them higher and the lobes
    unequal.
    """
    ball = icosphere(1.0, 5)
    n = ball.vertices
    angle = np.arctan2(n[:, 1], n[:, 0])
    round_part = (1 - n[:, 2] ** 2) * (1 + 0.3 * np.cos(arms * angle))
    z = 4 * n[:, 2] + 2.0 * np.exp(-((n[:, 2] - 1) ** 2) / 0.1)
    z = z + lift_mm * np.exp(-(angle**2) / 0.1) * np.clip(n[:, 2], 0, None)
    return Mesh(np.column_stack([20 * n[:, :2] * (0.5 + round_part[:, None]), z]), ball.faces)
