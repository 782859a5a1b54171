"""Is a distance between scan and design one of their shapes, or only of their triangles?

The corners of the triangles of both are points of the part; between them a triangle is a chord. Over a
fissure that one triangle of the design spans, a point of the scan lies deep inside the design, and yet the
corners of that triangle lie on the scan. Where material is missing, they stand in front of it. So a distance
to a chord (`kernels.chords`) counts as a difference only where a corner of it confirms the distance: the
corner lies off the other surface too, on the opposite side as seen from there, and not only off a chord of
that: off a whole triangle, all corners of which lie off.
"""

from dataclasses import dataclass

import numpy as np

from pipeline.core.mesh import BoolArray, FloatArray, IndexArray
from pipeline.kernels.surface import Closest, Surface
from pipeline.verification.placed_scan import ShownSurface
from pipeline.verification.thresholds import DIFFERENCE


@dataclass(frozen=True, slots=True)
class ChordErrors:
    """Of the two surfaces under one pose. signed_mm, face : (n,) of the vertices of the scan's surface:
    distance to the design, + outside, and its closest triangle; visible_mm : below it nothing is a difference
    """

    design: Surface
    scan: ShownSurface
    signed_mm: FloatArray
    face: IndexArray
    visible_mm: float

    def explain_scan(self, face: IndexArray, signed_mm: FloatArray) -> BoolArray:
        """(n,) whether only chords of the design lie off the scan, for each vertex (or point) of the scan.

        face : (n,) closest triangle of the design; signed_mm : (n,) distance to it, + outside the design
        """
        explained = np.zeros(len(face), dtype=np.bool_)
        distance_mm = np.abs(signed_mm)
        asked = np.flatnonzero(
            (distance_mm > self._whole_mm) & self.design.chords.may_explain(face, distance_mm)
        )
        corners, of_asked = np.unique(self.design.mesh.faces[face[asked]], return_inverse=True)
        in_front_mm, found = self.scan.signed_distance(self.design.mesh.vertices[corners])
        of_scan_mm = self.signed_mm[self.scan.surface.mesh.faces[found]]
        is_chord = self.scan.surface.chords.is_chord[found]
        side = np.where(in_front_mm > 0, 1.0, -1.0)
        is_whole = ~is_chord | (-side[:, None] * of_scan_mm > self._whole_mm).all(axis=1)
        confirming_mm = np.where(is_whole, in_front_mm, 0.0)[of_asked.reshape(-1, 3)]
        opposite = -np.sign(signed_mm[asked])[:, None]
        explained[asked] = (opposite * confirming_mm <= self.visible_mm).all(axis=1)
        if not self.scan.is_reconstructed:  # at the rim of a piece that is missing not all corners are off
            ends = self.scan.surface.edges.ends
            is_confirmed = np.zeros(len(face), dtype=np.bool_)
            is_confirmed[asked] = ~explained[asked] & (distance_mm[asked] > self.visible_mm)
            explained[ends[is_confirmed[ends].any(axis=1)]] = False
        return explained

    def explain_design(self, points: FloatArray, face: IndexArray, closest: Closest) -> BoolArray:
        """(k,) whether only chords of either surface lie off the other, for places of the design.

        points : (k, 3) mm; face : (k,) the design's triangle that each lies on; closest : of the scan
        """
        explained = self._by_scan(points, closest)
        own = np.flatnonzero(~explained & self.design.chords.may_explain(face, closest.distance))
        corners, of_own = np.unique(self.design.mesh.faces[face[own]], return_inverse=True)
        at = self.design.mesh.vertices[corners]
        found = self.scan.closest(at)
        is_off = (found.distance > self.visible_mm) & ~self._by_scan(at, found)
        explained[own] = ~is_off[of_own.reshape(-1, 3)].any(axis=1)
        return explained

    @property
    def _whole_mm(self) -> float:
        """How far off all corners of a triangle lie that lies off as a whole."""
        return DIFFERENCE.whole_triangle_ratio * self.visible_mm

    def _by_scan(self, points: FloatArray, closest: Closest) -> BoolArray:
        """(k,) whether the closest triangle of the scan is a chord, and no corner confirms the distance."""
        surface, explained = self.scan.surface, np.zeros(len(points), dtype=np.bool_)
        asked = np.flatnonzero(surface.chords.may_explain(closest.face, closest.distance))
        to_point = points[asked] - closest.point[asked]
        side = np.where(np.einsum("kd,kd->k", to_point, closest.normal[asked]) > 0, 1.0, -1.0)
        corners, of_asked = np.unique(surface.mesh.faces[closest.face[asked]], return_inverse=True)
        of_design = self.design.mesh.faces[self.face[corners]]
        design_corners, of_corner = np.unique(of_design, return_inverse=True)
        in_front_mm, _ = self.scan.signed_distance(self.design.mesh.vertices[design_corners])
        of_design_mm = in_front_mm[of_corner.reshape(-1, 3)]
        is_chord = self.design.chords.is_chord[self.face[corners]]
        outside = np.where(self.signed_mm[corners] > 0, 1.0, -1.0)
        is_whole = ~is_chord | (-outside[:, None] * of_design_mm > self._whole_mm).all(axis=1)
        confirming_mm = np.where(is_whole, self.signed_mm[corners], 0.0)[of_asked.reshape(-1, 3)]
        explained[asked] = (-side[:, None] * confirming_mm <= self.visible_mm).all(axis=1)
        return explained
