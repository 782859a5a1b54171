"""Parts by formula that no gauntlet has, drawn without turning to any part of the method: a knot, a spring, a
shaft, a hub, a bottle, a tray, a house. Lengths in mm.
"""

import numpy as np

from pipeline.core.mesh import FloatArray, Mesh
from tests.support.variants import solids

WINDOW_MM = 22.0


def knot(lobes: int = 3) -> Mesh:
    """A tube along a trefoil, or a knot of five lobes, with swellings: no turn maps it onto itself."""
    s = np.linspace(0, 2 * np.pi, 200 * (lobes - 1), endpoint=False)
    if lobes == 3:
        x, y, z = np.sin(s) + 2 * np.sin(2 * s), np.cos(s) - 2 * np.cos(2 * s), -np.sin(3 * s)
        line, radius = 10 * np.stack([x, y, z], axis=1), 3 + 1.2 * _bump(s, 1.0, 0.35)
        return _tube(line, radius + 0.7 * _bump(s, 4.0, 0.2))
    out = 20 + 8 * np.cos(5 * s)
    line = np.stack([out * np.cos(2 * s), out * np.sin(2 * s), -8 * np.sin(5 * s)], axis=1)
    return _tube(line, 2.6 + 0.9 * _bump(s, 1.0, 0.3))


def spring(turns: int = 5, hand: int = 1) -> Mesh:
    """A coil of whole turns; half a turn about an axis across maps it onto itself."""
    angle = np.linspace(0, 2 * np.pi * turns, 100 * turns)
    x, y = 12 * np.cos(angle), 12 * np.sin(hand * angle)
    return _tube(np.stack([x, y, 7 * angle / (2 * np.pi)], axis=1), np.full(len(angle), 1.6), closed=False)


def shaft(*, has_keyway: bool = True, groove_mm: float = 30.0, longer_mm: float = 0.0) -> Mesh:
    """A stepped shaft with a groove, a flat and a keyway."""
    low = [(6, 0), (6, 18), (9, 18), (9, groove_mm), (8.2, groove_mm), (8.2, groove_mm + 2)]
    high = [(9, groove_mm + 2), (9, 46), (7, 46), (7, 70 + longer_mm), (4, 74 + longer_mm)]
    turned = solids.stacked(np.array([*low, *high], dtype=np.float64))
    if not has_keyway:
        return turned
    keyway = solids.block((-1.5, 5.2, 50.0), (1.5, 9.0, 66.0))
    return solids.carved([turned], [keyway, solids.block((-7.0, 4.2, -1.0), (7.0, 9.0, 9.0))])


def hub(holes: int = 5, *, missing: int | None = None, has_ribs: bool = True) -> Mesh:
    """A flange with a bore, a keyway, two ribs and a ring of holes."""
    bodies = [solids.cylinder((0, 0), 30, 0, 5), solids.cylinder((0, 0), 12, 0, 22)]
    if has_ribs:
        bodies += [solids.block((9, -1, 4), (27, 1, 12)), solids.block((-27, -1, 4), (-9, 1, 9))]
    cuts = [solids.cylinder((0, 0), 7, -1, 23), solids.block((-1.5, 5, -1), (1.5, 9, 23))]
    angles = 2 * np.pi * np.arange(holes) / holes + 0.3
    cuts += [
        solids.cylinder((21 * np.cos(angle), 21 * np.sin(angle)), 2.5, -1, 6)
        for number, angle in enumerate(angles)
        if number != missing
    ]
    return solids.carved(bodies, cuts)


def bottle() -> Mesh:
    """A thin wall, nearly of revolution."""
    z = np.linspace(0, 1, 60)
    out = 14 + 4 * np.sin(1.6 * np.pi * z) + 3 * z - 27 * np.clip(z - 0.75, 0, 1)
    outer, inner = np.stack([out, 60 * z], axis=1), np.stack([out - 1.2, 60 * z], axis=1)
    made = solids.revolved(np.concatenate([outer, inner[::-1]]))
    angle, height = np.arctan2(made.vertices[:, 1], made.vertices[:, 0]), made.vertices[:, 2] / 60
    wave = 1 + 0.1 * np.cos(2 * angle + 0.4) * np.sin(np.pi * height) + 0.05 * np.cos(angle) * height
    return Mesh(made.vertices * np.column_stack([wave, wave, np.ones(len(wave))]), made.faces)


def tray() -> Mesh:
    """An open box with walls of 2 mm, cut-outs and four posts."""
    posts = [(6.0, 6.0), (64.0, 6.0), (6.0, 37.0), (60.0, 37.0)]
    cuts = [
        *(solids.block((2, 2, 2), (68, 43, 20)), solids.block((-1, 10, 8), (3, 22, 20))),
        *(solids.block((67, 30, 6), (71, 38, 20)), solids.block((30, 42, 9), (44, 46, 20))),
    ]
    box = solids.carved([solids.block((0, 0, 0), (70, 45, 14)), solids.cylinder((0, 45), 4, 0, 14)], cuts)
    return solids.carved(
        [box, *(solids.cylinder(at, 2.2, 1.9, 8) for at in posts)],
        [solids.cylinder(at, 0.8, 4, 9) for at in posts],
    )


def house(*, has_chimney: bool = True, window_mm: float = WINDOW_MM) -> Mesh:
    """Walls, a roof that stands over, a door and two windows."""
    roof = solids.prism_along_y(np.array([[-2.0, 22.0], [42.0, 22.0], [20.0, 38.0]]), -2, 32)
    bodies = [solids.block((0, 0, 0), (40, 30, 22)), roof]
    if has_chimney:
        bodies.append(solids.block((28, 8, 20), (33, 13, 40)))
    cuts = [
        solids.block((5, -1, 5), (13, 3, 20)),
        solids.block((window_mm, -1, 9), (window_mm + 12, 2, 18)),
        solids.block((38, 6, 8), (41, 16, 18)),
    ]
    return solids.carved(bodies, cuts)


def _bump(s: FloatArray, at: float, width: float) -> FloatArray:
    return np.asarray(np.exp(-(((s - at) / width) ** 2)))


def _tube(line: FloatArray, radius_mm: FloatArray, around: int = 22, *, closed: bool = True) -> Mesh:
    """Along a line (n, 3): a ring, or with a disc at both ends."""
    n = len(line)
    along = np.roll(line, -1, axis=0) - np.roll(line, 1, axis=0) if closed else np.gradient(line, axis=0)
    along /= np.linalg.norm(along, axis=1, keepdims=True)
    across = np.cross(along, [0.3, 0.2, 1.0])
    across /= np.linalg.norm(across, axis=1, keepdims=True)
    angle = 2 * np.pi * np.arange(around) / around
    ring = (
        np.cos(angle)[:, None] * across[:, None] + np.sin(angle)[:, None] * np.cross(along, across)[:, None]
    )
    vertices = (line[:, None] + radius_mm[:, None, None] * ring).reshape(-1, 3)
    index = np.arange(n * around).reshape(n, around)
    a, c = (index, np.roll(index, -1, axis=0)) if closed else (index[:-1], index[1:])
    b, d = np.roll(a, -1, axis=1), np.roll(c, -1, axis=1)
    faces = [np.stack([a, b, c], axis=-1).reshape(-1, 3), np.stack([b, d, c], axis=-1).reshape(-1, 3)]
    if not closed:
        vertices = np.concatenate([vertices, line[[0, -1]]])
        for end, centre in ((index[0][::-1], n * around), (index[-1], n * around + 1)):
            faces.append(np.stack([np.full(around, centre), end, np.roll(end, -1)], axis=1))
    mesh = Mesh(vertices, np.concatenate(faces).astype(np.int32))
    corners = mesh.vertices[mesh.faces]
    volume = np.einsum("fi,fi->", corners[:, 0], np.cross(corners[:, 1], corners[:, 2]))
    return mesh if volume > 0 else Mesh(mesh.vertices, mesh.faces[:, ::-1])
