"""A scan, or its mirror image, as it lies on the design under one pose."""

from dataclasses import dataclass

import numpy as np

from pipeline.core.mesh import FloatArray, IndexArray, Mesh
from pipeline.core.stations import Stations
from pipeline.kernels import rigid
from pipeline.kernels.surface import Closest, Surface
from pipeline.stages.registration import Fit

#: 4 x 4 of the reflection that `pipeline.search.types.mirror_mesh` applies.
REFLECTION = np.diag([-1.0, 1.0, 1.0, 1.0])


@dataclass(frozen=True, slots=True)
class PlacedScan:
    """mesh : the cleaned scan, or its mirror image; fit : of its vertices; normal_sign : -1 where its normals
    look inward under that pose; working : its working mesh; working_of_clean : (n,) vertex of `working` for
    each vertex of `mesh`; surface : of the scan itself, None of a cloud; is_mirrored : whether `mesh` is the
    image; stations : where the scanner of `mesh` stood, None where that is not known
    """

    mesh: Mesh
    fit: Fit
    normal_sign: float
    working: Mesh
    working_of_clean: IndexArray
    surface: Surface | None
    is_mirrored: bool = False
    stations: Stations | None = None

    def shown(self) -> "ShownSurface":
        """What the scan shows, with triangles: of a cloud its working mesh."""
        T = self.fit.T_design_scan
        if self.surface is None:
            return ShownSurface(Surface(self.working), T, self.normal_sign, is_reconstructed=True)
        return ShownSurface(self.surface, T @ REFLECTION if self.is_mirrored else T, self.normal_sign)


@dataclass(frozen=True, slots=True)
class ShownSurface:
    """surface : in a frame of its own; T_design_surface : (4, 4), a motion, of a mirror image with a
    reflection; is_reconstructed : from the points of a cloud
    """

    surface: Surface
    T_design_surface: FloatArray
    normal_sign: float
    is_reconstructed: bool = False

    def closest(self, points: FloatArray) -> Closest:
        """The closest points of the surface for `points` (k, 3), in the frame of the design; the normals look
        outward.
        """
        T = self.T_design_surface
        found = self.surface.closest(rigid.transformed(rigid.inverse(T), points))
        return Closest(
            rigid.transformed(T, found.point),
            found.face,
            found.weights,
            found.distance,
            self.normal_sign * found.normal @ T[:3, :3].T,
        )

    def signed_distance(self, points: FloatArray) -> tuple[FloatArray, IndexArray]:
        """(k,) mm of `points` (k, 3), in the frame of the design, to the surface, positive in front of it,
        and (k,) its closest triangle; 0 where the closest place is an open border, beyond which nothing was
        scanned.
        """
        local = rigid.transformed(rigid.inverse(self.T_design_surface), points)
        found = self.surface.closest(local)
        signed_mm = self.normal_sign * self.surface.signed_distance(local, found)
        return np.where(self.surface.on_open_border(found), 0.0, signed_mm), found.face
