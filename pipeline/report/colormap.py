"""Deviation in colours: blue where material is missing, red where there is too much, grey where it fits.

The diverging map of Moreland, "Diverging Color Maps for Scientific Visualization" (2009): in Msh space, so
that equal steps look equal, symmetric about zero, without the rainbow's false edges; told apart by people who
see colours differently.
"""

from dataclasses import dataclass
from functools import cache

import numpy as np

from pipeline.core.mesh import BoolArray, FloatArray

BLUE, RED = (59, 76, 192), (180, 4, 38)
WHITE_M = 88.0  # of the middle
STEPS = 257
NOT_COUNTED = np.array([0.45, 0.45, 0.45])  # darker than the middle of the map: says nothing about the print
LIMIT_QUANTILE = 0.99
_D65 = np.array([0.95047, 1.0, 1.08883])
_XYZ_OF_RGB = np.array(
    [[0.4124564, 0.3575761, 0.1804375], [0.2126729, 0.7151522, 0.0721750], [0.0193339, 0.1191920, 0.9503041]]
)


@dataclass(frozen=True, slots=True)
class ColourScale:
    """limit_mm : deviations beyond it have the end colours; tolerance_mm : within it all is the middle, None:
    nothing is
    """

    limit_mm: float
    tolerance_mm: float | None

    @classmethod
    def of(cls, signed_mm: FloatArray, counted: BoolArray, tolerance_mm: float | None) -> "ColourScale":
        """99 % of what is counted lies within the limit, a round number; with a tolerance at least twice
        that.
        """
        sizes = np.abs(signed_mm[counted])
        needed = float(np.quantile(sizes, LIMIT_QUANTILE)) if sizes.size else 0.0
        return cls(round_up(max(needed, 2 * (tolerance_mm or 0.0))), tolerance_mm)

    def colours(self, signed_mm: FloatArray, counted: BoolArray | None = None) -> FloatArray:
        """(n, 3) red, green, blue in [0, 1]."""
        band = self.tolerance_mm or 0.0
        beyond = np.sign(signed_mm) * np.maximum(np.abs(signed_mm) - band, 0.0)
        share = np.clip(beyond / max(self.limit_mm - band, 1e-12), -1.0, 1.0)
        found = table()[np.rint((share + 1) / 2 * (STEPS - 1)).astype(np.int64)]
        if counted is not None:
            found[~counted] = NOT_COUNTED
        return found


def round_up(value: float) -> float:
    """To the next of 1, 1.5, 2, 3, 5, 7.5 times a power of ten; 1e-6 for less."""
    if value <= 1e-6:
        return 1e-6
    power = 10.0 ** np.floor(np.log10(value))
    steps = np.array([1, 1.5, 2, 3, 5, 7.5, 10]) * power
    return float(steps[np.searchsorted(steps, value * (1 - 1e-9))].round(12))


@cache
def table() -> FloatArray:
    """(257, 3) the map from -1 to 1."""
    low, high = (_msh_of_rgb(np.array(end) / 255) for end in (BLUE, RED))
    middle = max(low[0], high[0], WHITE_M)
    halves = []
    for end, sign in ((low, 1), (high, -1)):
        white = np.array([middle, 0.0, _spun(end, middle)])
        t = np.linspace(0.0, 1.0, STEPS // 2 + 1)[:, None]
        half = (1 - t) * end + t * white
        halves.append(half[::sign])
    msh = np.concatenate([halves[0], halves[1][1:]])
    return np.array([_rgb_of_msh(each) for each in msh])


def _spun(end: FloatArray, white_m: float) -> float:
    """The hue at which the middle is reached (Moreland, figure 9)."""
    m, s, h = end
    if m >= white_m:
        return float(h)
    spin = s * np.sqrt(white_m**2 - m**2) / (m * np.sin(s))
    return float(h + spin if h > -np.pi / 3 else h - spin)


def _msh_of_rgb(rgb: FloatArray) -> FloatArray:
    linear = np.where(rgb > 0.04045, ((rgb + 0.055) / 1.055) ** 2.4, rgb / 12.92)
    x, y, z = (_XYZ_OF_RGB @ linear) / _D65
    fx, fy, fz = (v ** (1 / 3) if v > 0.008856 else 7.787 * v + 16 / 116 for v in (x, y, z))
    lightness, a, b = 116 * fy - 16, 500 * (fx - fy), 200 * (fy - fz)
    m = float(np.sqrt(lightness**2 + a**2 + b**2))
    return np.array([m, np.arccos(lightness / m), np.arctan2(b, a)])


def _rgb_of_msh(msh: FloatArray) -> FloatArray:
    m, s, h = msh
    lightness, a, b = m * np.cos(s), m * np.sin(s) * np.cos(h), m * np.sin(s) * np.sin(h)
    fy = (lightness + 16) / 116
    cubes = np.array([fy + a / 500, fy, fy - b / 200])
    xyz = _D65 * np.where(cubes**3 > 0.008856, cubes**3, (cubes - 16 / 116) / 7.787)
    linear = np.clip(np.linalg.solve(_XYZ_OF_RGB, xyz), 0.0, 1.0)
    return np.clip(
        np.where(linear > 0.0031308, 1.055 * linear ** (1 / 2.4) - 0.055, 12.92 * linear), 0.0, 1.0
    )
