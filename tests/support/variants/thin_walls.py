"""Scans of a thin wall from one side: can the surfaces alone tell which side of the wall it is?

- Both sides: yes. A scan of them shows the wall itself.
- The whole outside or the whole inside: yes, with right normals. Without them the rival is the scan moved by
  one wall along z: what is vertical stays where it was, the lid lies on the other face of the lid. All that
  tells is the rim, the notch, and the edges of lid and pad: 0.5 to 20 % of the scan, measured for each case.
- The panel, flat, with holes: it fits both sides exactly, one wall apart. Only right normals tell.
- Reversed normals tell the wrong side: here they count as none.
- None of them, when the wall is too thin for the noise.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from enum import StrEnum

import numpy as np

from pipeline.core.mesh import FloatArray, Mesh
from pipeline.kernels import rigid, sampling
from pipeline.kernels.surface import Surface
from tests.support.variants.expected import VISIBLE_PATCH_SHARE, VISIBLE_PER_NOISE
from tests.support.variants.thin_cover import Faces, thin_cover

#: Walls of the cases, mm.
WALLS_MM = (0.5, 1.0, 1.5, 3.0)
#: Points of a scan without triangles.
CLOUD_POINTS = 8000
#: Noise of the scan, 1 sigma, mm, that `is_side_tellable` is for by default: a good structured-light scanner.
NOISE_MM = 0.05


class Normals(StrEnum):
    """How a scan is oriented. ABSENT: points only."""

    RIGHT = "right"
    REVERSED = "reversed"
    ABSENT = "absent"


@dataclass(frozen=True, slots=True, eq=False)
class ThinWallCase:
    """scan_surface : a mesh or a cloud, without noise, in the frame of the design: T_design_scan is the
    identity; T_other_side : (4, 4) the rival pose, one wall along z, None where both sides are scanned;
    other_side_rms_mm, other_side_share : distance that the rival leaves between scan and design, and share of
    the scan that it leaves visibly off, both 0 without a rival
    """

    name: str
    wall_mm: float
    design: Mesh
    scan_surface: Mesh
    faces: Faces
    normals: Normals
    is_side_tellable: bool
    T_other_side: FloatArray | None
    other_side_rms_mm: float
    other_side_share: float


def thin_wall_cases(noise_mm: float = NOISE_MM) -> Iterator[ThinWallCase]:
    """Every wall, every set of faces, every orientation: 60 cases."""
    for wall_mm in WALLS_MM:
        for faces in Faces:
            for normals in Normals:
                yield thin_wall_case(wall_mm, faces, normals, noise_mm)


def thin_wall_case(
    wall_mm: float, faces: Faces, normals: Normals, noise_mm: float = NOISE_MM
) -> ThinWallCase:
    """One case. noise_mm : of the scan that is made of it, for `is_side_tellable` only"""
    cover, rival = thin_cover(wall_mm), _other_side(wall_mm, faces)
    surface, off_mm = cover.surface(faces), np.zeros(1)
    if rival is not None:
        points = sampling.on_surface(surface, CLOUD_POINTS, 0).points
        off_mm = Surface(cover.mesh).closest(rigid.transformed(rival, points)).distance
    limit_mm = VISIBLE_PER_NOISE * noise_mm
    share = float(np.mean(off_mm > limit_mm))
    shown = faces is Faces.BOTH or normals is Normals.RIGHT or share >= VISIBLE_PATCH_SHARE
    return ThinWallCase(
        name=f"cover with {wall_mm:g} mm walls, {faces}, normals {normals}",
        wall_mm=wall_mm,
        design=cover.mesh,
        scan_surface=oriented(surface, normals),
        faces=faces,
        normals=normals,
        is_side_tellable=wall_mm > limit_mm and shown,
        T_other_side=rival,
        other_side_rms_mm=float(np.sqrt(np.mean(off_mm**2))),
        other_side_share=share,
    )


def oriented(surface: Mesh, normals: Normals) -> Mesh:
    """The surface with triangles as they are or turned over, or points of equal area instead."""
    match normals:
        case Normals.RIGHT:
            return surface
        case Normals.REVERSED:
            return Mesh(surface.vertices, surface.faces[:, ::-1])
        case Normals.ABSENT:
            return Mesh(sampling.on_surface(surface, CLOUD_POINTS, 0).points)


def _other_side(wall_mm: float, faces: Faces) -> FloatArray | None:
    """One wall down for a scan of the outside, up for one of the inside."""
    if faces is Faces.BOTH:
        return None
    T = np.eye(4)
    T[2, 3] = -wall_mm if faces in {Faces.OUTER, Faces.PANEL_OUTER} else wall_mm
    return T
