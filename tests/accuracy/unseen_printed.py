"""Printed parts by formula that no limit was set on, as depth cameras of about 1 mm see them. Lengths in mm.

After what assembly benchmarks and workshops print: plates with holes, pegs, grids, brackets, handles, gears.
Some repeat themselves under a turn, which the truths of `unseen.py` know by `symmetries.self_maps`.
"""

import numpy as np

from pipeline.core.mesh import Mesh
from tests.support import shapes
from tests.support.variants import solids


def faceplate() -> Mesh:
    """A plate with two pockets, a slot and a step at one end."""
    bodies = [solids.block((0, 0, 0), (110, 60, 10)), solids.block((0, 0, 10), (16, 60, 18))]
    cuts = [
        *(solids.cylinder((35, 20), 9, -1, 11), solids.cylinder((35, 45), 6, 4, 11)),
        *(solids.block((60, 12, -1), (95, 24, 11)), solids.block((66, 40, 5), (96, 52, 11))),
    ]
    return solids.carved(bodies, cuts)


def bookshelf() -> Mesh:
    """An open grid of four by two boxes with a back: one box is like the next."""
    cuts = [
        solids.block((4 + 24 * i, -1, 4 + 34 * j), (24 + 24 * i, 22, 34 + 34 * j))
        for i in range(4)
        for j in range(2)
    ]
    return solids.carved([solids.block((0, 0, 0), (100, 25, 72))], cuts)


def peg() -> Mesh:
    """A round peg with a head: of revolution."""
    return solids.stacked(
        np.array([(9, 0), (10, 1), (10, 60), (18, 60), (18, 74), (16, 76)], dtype=np.float64)
    )


def square_post() -> Mesh:
    """A square post on a square foot, with a bevelled end."""
    return solids.carved(
        [solids.block((-20, -20, 0), (20, 20, 10)), solids.block((-9, -9, 8), (9, 9, 80))],
        [solids.block((-30, -30, 78), (-7, 30, 90)), solids.block((7, -30, 78), (30, 30, 90))],
    )


def hook() -> Mesh:
    """A wall hook: a plate with two screw holes and a bent arm."""
    angles = np.linspace(-np.pi / 2, np.pi / 3, 24)
    outer = np.stack([42 + 22 * np.cos(angles), 22 + 22 * np.sin(angles)], axis=1)
    inner = np.stack([42 + 13 * np.cos(angles), 22 + 13 * np.sin(angles)], axis=1)[::-1]
    arm = [
        solids.prism_along_y(
            np.array([outer[i], outer[i + 1], inner[-2 - i], inner[-1 - i]], dtype=np.float64), 11, 23
        )
        for i in range(len(outer) - 1)
    ]
    bodies = [solids.block((0, 0, -20), (6, 34, 70)), solids.block((4, 11, 0), (43, 23, 9)), *arm]
    cuts = [solids.z_to_x(solids.cylinder((17, z), 3, -1, 7)) for z in (-10, 58)]
    return solids.carved(bodies, cuts)


def mug() -> Mesh:
    """A cup with a square handle."""
    bodies = [solids.cylinder((0, 0), 32, 0, 80), solids.block((28, -6, 14), (58, 6, 66))]
    cuts = [solids.cylinder((0, 0), 28, 5, 81), solids.block((31, -7, 24), (48, 7, 56))]
    return solids.carved(bodies, cuts)


def stand() -> Mesh:
    """A stand for a telephone: a slanting back, a lip, a foot and a slot for a cable."""
    side = np.array(
        [(0, 0), (75, 0), (75, 6), (30, 6), (62, 95), (55, 98), (22, 8), (8, 8), (8, 18), (0, 18)]
    )
    slabs = [side[[0, 1, 2, 3, 6, 7]], side[[0, 7, 8, 9]], side[[6, 3, 4, 5]]]
    bodies = [solids.prism_along_y(slab, 0, 70) for slab in slabs]
    return solids.carved(bodies, [solids.block((-5, 28, -1), (60, 42, 40))])


def tee() -> Mesh:
    """A pipe tee with one flange."""
    along = solids.z_to_x(solids.cylinder((0, 0), 15, -45, 45))
    bodies = [along, solids.cylinder((0, 0), 13, 0, 48), solids.cylinder((0, 0), 24, 42, 48)]
    cuts = [solids.z_to_x(solids.cylinder((0, 0), 11, -46, 46)), solids.cylinder((0, 0), 9, 0, 49)]
    return solids.carved(bodies, cuts)


def knob() -> Mesh:
    """A star knob of seven arms with a stem that has a flat."""
    angles = 2 * np.pi * np.arange(7) / 7
    arms = [solids.cylinder((24 * np.cos(a), 24 * np.sin(a)), 9, 0, 16) for a in angles]
    bodies = [solids.cylinder((0, 0), 24, 0, 16), *arms, solids.cylinder((0, 0), 11, 14, 40)]
    cuts = [solids.block((6, -20, 24), (20, 20, 50)), solids.cylinder((0, 0), 4, 20, 41)]
    return solids.carved(bodies, cuts)


def hinge() -> Mesh:
    """One leaf of a hinge, with three knuckles and four holes."""
    knuckles = [solids.z_to_y(solids.cylinder((4, 0), 7, y, y + 16)) for y in (0, 32, 64)]
    bodies = [solids.block((0, 0, 0), (50, 80, 5)), *knuckles]
    cuts = [solids.cylinder((x, y), 3, -1, 6) for x in (22, 40) for y in (14, 66)]
    cuts += [solids.z_to_y(solids.cylinder((4, 0), 3, -1, 81))]
    cuts += [solids.block((-9, y, -9), (9, y + 17, 14)) for y in (15.5, 47.5)]
    return solids.carved(bodies, cuts)


def brick() -> Mesh:
    """A toy brick, two by four, hollow: half a turn maps it onto itself."""
    studs = [solids.cylinder((10 + 20 * i, 10 + 20 * j), 6, 20, 26) for i in range(4) for j in range(2)]
    return solids.carved(
        [solids.block((0, 0, 0), (80, 40, 22)), *studs], [solids.block((4, 4, -1), (76, 36, 18))]
    )


def pulley() -> Mesh:
    """A wheel with a groove, a bore with a keyway and four spokes' windows, one of them smaller."""
    profile = np.array([(38, 0), (38, 4), (30, 9), (38, 14), (38, 18)], dtype=np.float64)
    windows = [(19.0, 0.0, 7.0), (0.0, 19.0, 7.0), (-19.0, 0.0, 7.0), (0.0, -19.0, 4.0)]
    cuts = [solids.cylinder((x, y), r, -1, 19) for x, y, r in windows]
    cuts += [solids.cylinder((0, 0), 6, -1, 29), solids.block((-1.5, 4, -1), (1.5, 8, 29))]
    return solids.carved([solids.stacked(profile), solids.cylinder((0, 0), 11, 17, 28)], cuts)


def gear() -> Mesh:
    """A spur gear of 17 teeth on a hub with a screw hole."""
    step = 2 * np.pi / 17
    teeth = [
        np.array([(26, -0.30), (36, -0.16), (36, 0.16), (26, 0.30)]) * [1.0, step] + [0.0, k * step]
        for k in range(17)
    ]
    wedges = [
        solids.prism(np.stack([t[:, 0] * np.cos(t[:, 1]), t[:, 0] * np.sin(t[:, 1])], axis=1), 0, 14)
        for t in teeth
    ]
    bodies = [solids.cylinder((0, 0), 30, 0, 14), solids.cylinder((0, 0), 14, 12, 30), *wedges]
    cuts = [solids.cylinder((0, 0), 6, -1, 31), solids.z_to_x(solids.cylinder((0, 22), 2.5, 0, 20))]
    return solids.carved(bodies, cuts)


def figure() -> Mesh:
    """A smooth toy: a body, a head and two arms, without an edge that is sharp to a camera."""
    parts = (
        *((0.0, 0.0, 25.0, 24.0), (3.0, 0.0, 60.0, 17.0), (20.0, 14.0, 38.0, 8.0)),
        *((16.0, -20.0, 30.0, 9.0), (-16.0, 4.0, 4.0, 10.0)),
    )
    balls = [shapes.icosphere(r, 4) for *_, r in parts]
    placed = [
        Mesh(ball.vertices + np.array([x, y, z]), ball.faces)
        for ball, (x, y, z, _) in zip(balls, parts, strict=True)
    ]
    return solids.carved(placed, [solids.block((-60, -60, -40), (60, 60, 0))])


PARTS = {
    made.__name__: made
    for made in (
        *(faceplate, bookshelf, peg, square_post, hook, mug, stand, tee, knob, hinge, brick, pulley, gear),
        figure,
    )
}
