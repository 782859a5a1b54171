"""The crowns of the demo's dental arch, by formula: four kinds of teeth that differ by their numbers only.

A crown is the inside of a tapering superellipse, cut by its occlusal surface, joined smoothly:

    side  = min(W, D) (((|u| / W)^e + (|v - c| / D)^e)^(1/e) - 1),   W(z), D(z), c(z): waist, taper, lean
    top   = 0.8 (z - occlusal(u, v)),                                crown = smax(side, top)
    occlusal(u, v) = log-sum-exp over cusps of (h - slope sqrt(du^2 + dv^2 + r^2)) + marginal ridges
    smin(a, b) = (a + b - sqrt((a - b)^2 + k^2)) / 2,                smax(a, b) = -smin(-a, -b)

with u away from the middle of the arch, v towards the cheek and z towards the bite, in mm. Fissures are where
the cones of two cusps meet. Incisors taper to a blade with a nearly level edge, canines have one point,
premolars two cusps, first molars five, second molars four. Sizes are after Wheeler's Dental Anatomy.
"""

from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
import numpy.typing as npt

FloatArray: TypeAlias = npt.NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Kind:
    """One kind of crown, in mm; a cusp is (u, v, drop) in half widths, half depths, mm below the highest."""

    name: str
    width: float
    depth: float
    height: float
    squareness: float
    waist: float  # width at the gum, of the largest
    taper: float  # of the depth, from the gum to the top
    lean: float  # towards the cheek: 1 keeps the outer face upright
    point: float  # of the width, from the middle to the top
    slope: float  # of the cusps
    ridge: float  # height of the marginal ridges
    cusps: tuple[tuple[float, float, float], ...]


_PREMOLAR = ((0.0, 0.52, 0.0), (0.0, -0.5, 0.7))
_MOLAR = ((-0.42, 0.5, 0.0), (0.42, 0.5, 0.25), (-0.4, -0.48, 0.3), (0.46, -0.5, 0.7))
_DISTAL = (0.8, 0.02, 0.75)  # the fifth cusp, on the far marginal ridge
CENTRAL = Kind("central incisor", 8.7, 7.0, 9.4, 2.6, 0.74, 0.78, 0.62, 0.07, 0.22, 0.0, ((0.1, 0.55, 0.0),))
LATERAL = Kind("lateral incisor", 6.9, 6.4, 8.6, 2.5, 0.74, 0.76, 0.62, 0.11, 0.28, 0.0, ((0.1, 0.55, 0.0),))
CANINE = Kind("canine", 7.9, 8.0, 9.6, 2.2, 0.72, 0.62, 0.60, 0.18, 0.85, 0.0, ((0.0, 0.42, 0.0),))
PREMOLAR_1 = Kind("first premolar", 7.3, 9.2, 8.0, 2.4, 0.72, 0.20, 0.1, 0.0, 0.85, 0.45, _PREMOLAR)
PREMOLAR_2 = Kind("second premolar", 7.0, 9.1, 7.6, 2.4, 0.72, 0.18, 0.1, 0.0, 0.80, 0.45, _PREMOLAR)
MOLAR_1 = Kind("first molar", 10.6, 11.4, 7.2, 3.2, 0.80, 0.14, 0.0, 0.0, 0.85, 0.6, (*_MOLAR, _DISTAL))
MOLAR_2 = Kind("second molar", 9.8, 11.0, 6.8, 3.0, 0.80, 0.16, 0.0, 0.0, 0.85, 0.55, _MOLAR)
_HALF = (CENTRAL, LATERAL, CANINE, PREMOLAR_1, PREMOLAR_2, MOLAR_1, MOLAR_2)
KINDS = (*reversed(_HALF), *_HALF)  # from the right second molar around to the left one


def occlusal(kind: Kind, u: FloatArray, v: FloatArray) -> FloatArray:
    """Height above the gum line of a crown's biting surface at (u, v), mm from its centre."""
    half_width, half_depth = kind.width / 2, kind.depth / 2
    away = [
        np.sqrt((u - cu * half_width) ** 2 + (v - cv * half_depth) ** 2 + 0.5) for cu, cv, _ in kind.cusps
    ]
    cones = [kind.slope * (0.5**0.5 - r) - drop for r, (_, _, drop) in zip(away, kind.cusps, strict=True)]
    height = np.logaddexp.reduce(5.0 * np.stack(cones), axis=0) / 5.0  # fissures rounded over 1/5 mm
    ridge = kind.ridge * np.exp(-(((np.abs(u) - 0.82 * half_width) / (0.18 * half_width)) ** 2))
    return np.asarray(kind.height + height + ridge, dtype=np.float64)


def crown_field(kind: Kind, u: FloatArray, v: FloatArray, z: FloatArray) -> FloatArray:
    """Below zero inside the crown, about a distance in mm near its surface; the root has no end."""
    rise = np.clip(z / kind.height, 0.0, 1.0)
    belly = np.clip(rise / 0.6, 0.0, 1.0)
    belly = belly * belly * (3.0 - 2.0 * belly)
    above = np.clip((rise - 0.5) / 0.5, 0.0, 1.0)
    width = kind.width / 2 * (kind.waist + (1.0 - kind.waist) * belly) * (1.0 - kind.point * above)
    tapered = kind.taper * rise**1.3
    depth = kind.depth / 2 * (1.0 - tapered)
    centre = kind.lean * kind.depth / 2 * tapered
    e = kind.squareness
    radius = (np.abs(u / width) ** e + np.abs((v - centre) / depth) ** e) ** (1.0 / e)
    return smax(np.minimum(width, depth) * (radius - 1.0), 0.8 * (z - occlusal(kind, u, v)), 0.5)


def smin(a: FloatArray, b: FloatArray, k: float) -> FloatArray:
    """The lesser of two fields, rounded over about k mm where they meet."""
    return np.asarray((a + b - np.sqrt((a - b) ** 2 + k * k)) / 2)


def smax(a: FloatArray, b: FloatArray, k: float) -> FloatArray:
    """The greater of two fields, rounded over about k mm where they meet."""
    return -smin(-a, -b, k)
