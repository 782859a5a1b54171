"""A shallow open box with a thin wall, and its surface by side: outside, inside, and edges between them."""

from dataclasses import dataclass
from enum import StrEnum
from functools import lru_cache

import numpy as np

from pipeline.core.mesh import BoolArray, FloatArray, Mesh
from pipeline.kernels.surface import Surface
from tests.support.variants import solids

#: Outer size, mm, and outer radius of the corners: larger than the thickest wall, so that every corner is
#: round on both sides.
LENGTH_MM, WIDTH_MM, HEIGHT_MM, CORNER_MM = 80.0, 54.0, 16.0, 8.0
#: The raised pad on the lid, from corner to corner, and how far it rises.
PAD_LOW_MM, PAD_HIGH_MM, PAD_RISE_MM, PAD_CORNER_MM = (48.0, 9.0), (71.0, 33.0), 5.0, 5.0
#: Holes through the lid (x, y, radius): no turn and no reflection maps them on each other.
HOLES_MM = ((12.0, 12.0, 3.5), (33.0, 18.0, 2.2), (17.0, 41.0, 5.0))
#: Notch in the rim of one long wall: from x to x, and how high.
NOTCH_X_MM, NOTCH_HEIGHT_MM = (22.0, 36.0), 6.0
#: The panel: the flat piece of the lid around the holes, clear of corners and pad, from corner to corner.
PANEL_LOW_MM, PANEL_HIGH_MM = (CORNER_MM - 2.0, CORNER_MM - 2.0), (42.0, WIDTH_MM - CORNER_MM + 1.0)
MIN_WALL_MM, MAX_WALL_MM = 0.5, 3.0
#: A place nearer than this to a formula surface lies on it, mm: above rounding, far below a wall.
ON_SURFACE_MM = 1e-5


class Faces(StrEnum):
    """Which faces a scan shows. PANEL_*: the flat piece of the lid with the holes only, from one side."""

    OUTER = "outer"
    INNER = "inner"
    BOTH = "both"
    PANEL_OUTER = "panel outer"
    PANEL_INNER = "panel inner"


@dataclass(frozen=True, slots=True, eq=False)
class ThinCover:
    """mesh : closed, its opening at z = 0, the lid above; is_outer, is_inner : (m,) of its triangles; the
    others are edges: the rim, the notch, and the walls of the holes
    """

    wall_mm: float
    mesh: Mesh
    is_outer: BoolArray
    is_inner: BoolArray

    def surface(self, faces: Faces) -> Mesh:
        """The open surface that a scan of these faces shows; BOTH is the whole closed mesh."""
        match faces:
            case Faces.OUTER:
                return _part_of(self.mesh, self.is_outer)
            case Faces.INNER:
                return _part_of(self.mesh, self.is_inner)
            case Faces.BOTH:
                return self.mesh
            case Faces.PANEL_OUTER:
                return _panel(self.wall_mm, HEIGHT_MM)
            case Faces.PANEL_INNER:
                return _panel(self.wall_mm, HEIGHT_MM - self.wall_mm)


@lru_cache(maxsize=8)
def thin_cover(wall_mm: float) -> ThinCover:
    """The cover with walls of this thickness everywhere, lid and pad included."""
    if not MIN_WALL_MM <= wall_mm <= MAX_WALL_MM:
        raise ValueError(f"wall_mm is {wall_mm}, not within {MIN_WALL_MM} to {MAX_WALL_MM}")
    hollow, edges = _hollow(wall_mm), _edge_cuts()
    mesh = solids.carved(_outside(wall_mm), [*hollow, *edges])
    middle = mesh.vertices[mesh.faces].mean(axis=1)
    is_edge = (mesh.vertices[mesh.faces][:, :, 2].max(axis=1) < ON_SURFACE_MM) | _lies_on(middle, edges)
    is_inner = ~is_edge & _lies_on(middle, hollow)
    return ThinCover(wall_mm, mesh, ~is_edge & ~is_inner, is_inner)


def _outside(wall_mm: float) -> list[Mesh]:
    body = solids.rounded_rectangle((0.0, 0.0), (LENGTH_MM, WIDTH_MM), (CORNER_MM,) * 4)
    pad = solids.rounded_rectangle(PAD_LOW_MM, PAD_HIGH_MM, (PAD_CORNER_MM,) * 4)
    return [
        solids.prism(body, 0.0, HEIGHT_MM),
        solids.prism(pad, HEIGHT_MM - 0.5 * wall_mm, HEIGHT_MM + PAD_RISE_MM),
    ]


def _hollow(wall_mm: float) -> list[Mesh]:
    """What is cut from within: everything `wall_mm` farther in."""
    (px0, py0), (px1, py1) = PAD_LOW_MM, PAD_HIGH_MM
    body = solids.rounded_rectangle(
        (wall_mm, wall_mm), (LENGTH_MM - wall_mm, WIDTH_MM - wall_mm), (CORNER_MM - wall_mm,) * 4
    )
    pad = solids.rounded_rectangle(
        (px0 + wall_mm, py0 + wall_mm), (px1 - wall_mm, py1 - wall_mm), (PAD_CORNER_MM - wall_mm,) * 4
    )
    lid = HEIGHT_MM - wall_mm
    return [solids.prism(body, -1.0, lid), solids.prism(pad, lid - 1.0, lid + PAD_RISE_MM)]


def _edge_cuts() -> list[Mesh]:
    """Holes and notch, through the wall."""
    low, high = NOTCH_X_MM
    holes = [solids.cylinder((x, y), radius, 3.0, HEIGHT_MM + 1.0) for x, y, radius in HOLES_MM]
    return [*holes, solids.block((low, -1.0, -2.0), (high, MAX_WALL_MM + 1.0, NOTCH_HEIGHT_MM))]


def _lies_on(points_mm: FloatArray, meshes: list[Mesh]) -> BoolArray:
    return np.asarray(Surface(solids.joined(*meshes)).closest(points_mm).distance < ON_SURFACE_MM)


@lru_cache(maxsize=16)
def _panel(wall_mm: float, z_mm: float) -> Mesh:
    """The flat face at height `z_mm`, its normals away from the material: up outside, down inside."""
    (x0, y0), (x1, y1) = PANEL_LOW_MM, PANEL_HIGH_MM
    sheet = solids.block((x0, y0, HEIGHT_MM - wall_mm), (x1, y1, HEIGHT_MM))
    mesh = solids.carved([sheet], _edge_cuts())
    is_off = np.abs(mesh.vertices[:, 2] - z_mm) > ON_SURFACE_MM
    return _part_of(mesh, np.logical_not(is_off[mesh.faces].any(axis=1)))


def _part_of(mesh: Mesh, is_kept: BoolArray) -> Mesh:
    """Some triangles, with their vertices only."""
    used, faces = np.unique(mesh.faces[is_kept], return_inverse=True)
    return Mesh(mesh.vertices[used], faces.reshape(-1, 3).astype(np.int32))
