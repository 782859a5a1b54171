"""Colours of the deviation: blue for missing material, red for excess material, grey for no deviation.

The diverging colour map of Moreland, "Diverging Color Maps for Scientific Visualization" (2009). It is
interpolated in Msh space: perceptually uniform, symmetric about zero, without the false edges of a rainbow
map, and readable with colour vision deficiency.
"""

from dataclasses import dataclass
from functools import cache

import numpy as np

from pipeline.core.mesh import BoolArray, FloatArray

#: End colours, sRGB 0 to 255; from literature (Moreland 2009).
BLUE, RED = (59, 76, 192), (180, 4, 38)
#: M of the middle colour in Msh space; from literature (Moreland 2009).
WHITE_M = 88.0
#: Entries of the table; odd, so that one is the middle.
STEPS = 257
#: Colour of vertices that are not counted, RGB in [0, 1]; darker than the middle of the map.
NOT_COUNTED = np.array([0.45, 0.45, 0.45])
#: Least end of the scale: this many sigmas of the scanner's accuracy (else of the noise of the scan), and
#: this share of the diagonal of the design. No scan shows less: it is rounding, and arithmetic of distances.
#: Chosen by hand, not fitted. The page has the same (`service/web/colours.js`).
RESOLUTION_SIGMAS, RESOLUTION_SHARE = 2.0, 1e-4
#: White point D65 (XYZ) and the matrix from linear sRGB to XYZ; from the standard IEC 61966-2-1.
_D65 = np.array([0.95047, 1.0, 1.08883])
_XYZ_OF_RGB = np.array(
    [[0.4124564, 0.3575761, 0.1804375], [0.2126729, 0.7151522, 0.0721750], [0.0193339, 0.1191920, 0.9503041]]
)


@dataclass(frozen=True, slots=True)
class ColourScale:
    """Mapping from deviations to colours.

    limit_mm : larger absolute deviations have the end colours; tolerance_mm : absolute deviations within it
    have the middle colour; None for no such band
    """

    limit_mm: float
    tolerance_mm: float | None

    @classmethod
    def of(cls, needed_mm: float, resolution_mm: float, tolerance_mm: float | None) -> "ColourScale":
        """Scale whose limit is a round number and covers `needed_mm`, the resolution of the scan, and twice
        the tolerance.
        """
        return cls(round_up(max(needed_mm, resolution_mm, 2 * (tolerance_mm or 0.0))), tolerance_mm)

    def colours(self, signed_mm: FloatArray, counted: BoolArray | None = None) -> FloatArray:
        """(n, 3) RGB in [0, 1] of `signed_mm` (n,); vertices that are not `counted` are `NOT_COUNTED`."""
        band = self.tolerance_mm or 0.0
        beyond = np.sign(signed_mm) * np.maximum(np.abs(signed_mm) - band, 0.0)
        share = np.clip(beyond / max(self.limit_mm - band, 1e-12), -1.0, 1.0)
        colours = table()[np.rint((share + 1) / 2 * (STEPS - 1)).astype(np.int64)]
        if counted is not None:
            colours[~counted] = NOT_COUNTED
        return colours


def resolution_mm(accuracy_mm: float | None, noise_mm: float | None, diagonal_mm: float) -> float:
    """What a scan can show at least. accuracy_mm : of the scanner, None: not stated; noise_mm : of the scan,
    None: not known; diagonal_mm : of the design
    """
    sigma_mm = noise_mm if accuracy_mm is None else accuracy_mm
    return max(RESOLUTION_SIGMAS * (sigma_mm or 0.0), RESOLUTION_SHARE * diagonal_mm)


def round_up(value: float) -> float:
    """`value` rounded up to 1, 1.5, 2, 3, 5 or 7.5 times a power of ten; at least 1e-6."""
    if value <= 1e-6:
        return 1e-6
    power = 10.0 ** np.floor(np.log10(value))
    steps = np.array([1, 1.5, 2, 3, 5, 7.5, 10]) * power
    return float(steps[np.searchsorted(steps, value * (1 - 1e-9))].round(12))


@cache
def table() -> FloatArray:
    """(257, 3) RGB in [0, 1] for -1 to 1."""
    low, high = (_msh_of_rgb(np.array(end) / 255) for end in (BLUE, RED))
    middle = max(low[0], high[0], WHITE_M)
    halves = []
    for end, sign in ((low, 1), (high, -1)):
        white = np.array([middle, 0.0, _adjusted_hue(end, middle)])
        t = np.linspace(0.0, 1.0, STEPS // 2 + 1)[:, None]
        half = (1 - t) * end + t * white
        halves.append(half[::sign])
    msh = np.concatenate([halves[0], halves[1][1:]])
    return np.array([_rgb_of_msh(each) for each in msh])


def _adjusted_hue(end: FloatArray, white_m: float) -> float:
    """Hue of the middle colour on the side of the colour `end` (Moreland 2009, AdjustHue in figure 9)."""
    m, s, h = end
    if m >= white_m:
        return float(h)
    spin = s * np.sqrt(white_m**2 - m**2) / (m * np.sin(s))
    return float(h + spin if h > -np.pi / 3 else h - spin)


def _msh_of_rgb(rgb: FloatArray) -> FloatArray:
    """(3,) Msh of an sRGB colour (3,) in [0, 1], by way of CIELAB (Moreland 2009)."""
    linear = np.where(rgb > 0.04045, ((rgb + 0.055) / 1.055) ** 2.4, rgb / 12.92)
    x, y, z = (_XYZ_OF_RGB @ linear) / _D65
    fx, fy, fz = (v ** (1 / 3) if v > 0.008856 else 7.787 * v + 16 / 116 for v in (x, y, z))
    lightness, a, b = 116 * fy - 16, 500 * (fx - fy), 200 * (fy - fz)
    m = float(np.sqrt(lightness**2 + a**2 + b**2))
    return np.array([m, np.arccos(lightness / m), np.arctan2(b, a)])


def _rgb_of_msh(msh: FloatArray) -> FloatArray:
    """(3,) sRGB in [0, 1]; the inverse of `_msh_of_rgb`, clipped to the gamut."""
    m, s, h = msh
    lightness, a, b = m * np.cos(s), m * np.sin(s) * np.cos(h), m * np.sin(s) * np.sin(h)
    fy = (lightness + 16) / 116
    cubes = np.array([fy + a / 500, fy, fy - b / 200])
    xyz = _D65 * np.where(cubes**3 > 0.008856, cubes**3, (cubes - 16 / 116) / 7.787)
    linear = np.clip(np.linalg.solve(_XYZ_OF_RGB, xyz), 0.0, 1.0)
    return np.clip(
        np.where(linear > 0.0031308, 1.055 * linear ** (1 / 2.4) - 0.055, 12.92 * linear), 0.0, 1.0
    )
