"""Where the surface deviates most: single places with the area around them, not single vertices."""

import numpy as np
from scipy.sparse import csgraph, csr_matrix

from pipeline.core.mesh import BoolArray, FloatArray
from pipeline.core.results.inspection import Extreme
from pipeline.inspection.measured_surface import MeasuredSurface
from pipeline.inspection.patches import Patches

#: Places listed to each side. Chosen by hand.
LISTED = 3
#: Two places closer than so many patch diameters are one. Chosen by hand: their patches share no vertex.
APART = 2.0
#: Share of the largest deviation down to which the surface around belongs to it. Chosen by hand.
AREA_SHARE = 0.5


def extremes(surface: MeasuredSurface, found: Patches, adjacency: csr_matrix) -> list[Extreme]:
    """The places of the largest deviation, at most `LISTED` to each side, largest first.

    adjacency : (c, c) of the places, as `surface_patches.adjacency_of` the working mesh of the design
    """
    listed = [each for sign in (1.0, -1.0) for each in _to_side(surface, found, adjacency, sign)]
    return sorted(listed, key=lambda each: -abs(each.value_mm))


def _to_side(surface: MeasuredSurface, found: Patches, adjacency: csr_matrix, sign: float) -> list[Extreme]:
    value = np.where(np.isfinite(found.value_mm), sign * found.value_mm, 0.0)
    free = value > 0
    listed: list[Extreme] = []
    while free.any() and len(listed) < LISTED:
        top = int(np.where(free, value, -np.inf).argmax())
        error_mm = float(found.error_mm[top])
        listed.append(
            Extreme(
                position_mm=surface.place_mm[top].tolist(),
                value_mm=float(found.value_mm[top]),
                uncertainty_mm=error_mm if np.isfinite(error_mm) else None,
                segment=int(surface.segment_of_face[surface.place_face[top]]),
                area_mm2=_area_mm2(surface.place_area_mm2, adjacency, value, top),
            )
        )
        away = np.linalg.norm(surface.place_mm - surface.place_mm[top], axis=1)
        free &= (away > APART * found.diameter_mm) & (value < value[top])
        free &= ~_connected(adjacency, value, top)
    return listed


def _connected(adjacency: csr_matrix, value: FloatArray, top: int) -> BoolArray:
    """(c,) what hangs together with the place `top` and deviates by at least `AREA_SHARE` of it."""
    members = np.flatnonzero(value >= AREA_SHARE * value[top])
    piece = csgraph.connected_components(adjacency[members][:, members], directed=False)[1]
    inside: BoolArray = np.zeros(len(value), dtype=np.bool_)
    inside[members[piece == piece[np.searchsorted(members, top)]]] = True
    return inside


def _area_mm2(areas_mm2: FloatArray, adjacency: csr_matrix, value: FloatArray, top: int) -> float:
    return float(areas_mm2[_connected(adjacency, value, top)].sum())
