"""A crown as of a molar, enlarged as a study model is: a rounded block with cusps, fissures and a waist."""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from pipeline.core.mesh import FloatArray, Mesh
from tests.support import shapes
from tests.support.variants.dimensions import Dimensions

#: Subdivisions of the sphere: 10,242 vertices.
LEVELS = 5
#: Exponent of the superellipsoid that gives a crown its rounded square outline (chosen by eye).
SQUARENESS = 3.2


@dataclass(frozen=True, slots=True)
class Crown:
    """Biting surface upwards. cusps : (x, y, height, width) each and fissures : (x0, y0, x1, y1, depth,
    width) each, in shares of half the length
    """

    length_mm: float
    width_mm: float
    height_mm: float
    waist_share: float
    cusps: tuple[tuple[float, float, float, float], ...]
    fissures: tuple[tuple[float, float, float, float, float, float], ...]

    @classmethod
    def sampled(cls, seed: int) -> "Crown":
        """Four, five or three cusps in turn; another seed is another tooth."""
        draw = Dimensions("crown", seed)
        corners = {
            4: ((0.5, 0.45), (-0.5, 0.48), (0.45, -0.5), (-0.48, -0.45)),
            5: ((0.58, 0.42), (0.0, 0.58), (-0.56, 0.4), (0.48, -0.48), (-0.46, -0.5)),
            3: ((0.52, 0.48), (-0.5, 0.46), (0.05, -0.52)),
        }[(4, 5, 3)[seed % 3]]
        cusps = tuple(
            (
                x + draw.share(-0.07, 0.07),
                y + draw.share(-0.07, 0.07),
                draw.share(0.2, 0.36),
                draw.share(0.2, 0.28),
            )
            for x, y in corners
        )
        centre = draw.share(-0.1, 0.1), draw.share(-0.08, 0.08)
        ends = [(0.62, draw.share(-0.12, 0.12)), (-0.62, draw.share(-0.12, 0.12))]
        ends += [(draw.share(-0.2, 0.2), 0.85), (draw.share(-0.25, 0.25), -0.8)]
        fissures = tuple((*centre, *end, draw.share(0.14, 0.22), draw.share(0.06, 0.09)) for end in ends)
        return cls(draw.mm(40, 46), draw.mm(34, 40), draw.mm(26, 32), draw.share(0.12, 0.2), cusps, fissures)

    def mesh(self) -> Mesh:
        """The part, closed."""
        return _built(self)

    def changes(self) -> "dict[str, Crown]":
        """No local ones."""
        return {}


@lru_cache(maxsize=16)
def _built(part: Crown) -> Mesh:
    sphere = shapes.icosphere(1.0, LEVELS)
    n = sphere.vertices
    p = n / (np.abs(n) ** SQUARENESS).sum(axis=1, keepdims=True) ** (1 / SQUARENESS)
    p = np.array(p)
    p[:, 2] += _relief(part, p[:, :2]) * _smooth_step(p[:, 2], 0.1, 0.9)
    p[:, :2] *= (1 - part.waist_share * _smooth_step(-p[:, 2], -0.1, 1.0))[:, None]
    half = np.array([part.length_mm, part.width_mm, part.height_mm]) / 2
    return Mesh(p * half, sphere.faces)


def _relief(part: Crown, xy: FloatArray) -> FloatArray:
    """(k,) rise of the biting surface at xy (k, 2), in shares of half the height."""
    rise = np.full(len(xy), -0.12)
    for x, y, height, width in part.cusps:
        rise += 1.35 * height * np.exp(-((xy - (x, y)) ** 2).sum(axis=1) / (2 * width**2))
    for x0, y0, x1, y1, depth, width in part.fissures:
        start, along = np.array([x0, y0]), np.array([x1 - x0, y1 - y0])
        share = np.clip((xy - start) @ along / (along @ along), 0, 1)
        distance2 = ((xy - start - share[:, None] * along) ** 2).sum(axis=1)
        rise -= depth * np.exp(-distance2 / (2 * width**2))
    return rise


def _smooth_step(values: FloatArray, low: float, high: float) -> FloatArray:
    """0 below `low`, 1 above `high`, smooth between."""
    t = np.clip((values - low) / (high - low), 0, 1)
    return np.asarray(t * t * (3 - 2 * t), dtype=np.float64)
