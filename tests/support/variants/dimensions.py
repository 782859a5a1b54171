"""Seeded dimensions of formula parts."""

import zlib

import numpy as np

#: How far a hole is moved, shares of the design's diagonal: one that anybody sees, and one that the noise of
#: a usual scan (0.1 % of the diagonal) hides.
HOLE_MOVES = {"hole moved by 5 %": 0.05, "hole moved by 0.3 %": 0.003}


class Dimensions:
    """Draws dimensions, rounded to 0.1 mm as a designer would; the same family and seed, the same numbers."""

    def __init__(self, family: str, seed: int) -> None:
        self._rng = np.random.default_rng([seed, zlib.crc32(family.encode())])

    def mm(self, low_mm: float, high_mm: float) -> float:
        """A length."""
        return round(float(self._rng.uniform(low_mm, high_mm)), 1)

    def share(self, low: float, high: float) -> float:
        """A ratio."""
        return round(float(self._rng.uniform(low, high)), 3)
