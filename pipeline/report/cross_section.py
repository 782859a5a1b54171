"""Cross-sections through the places of the largest deviations: the outlines of design and scan in a plane,
near the place, the deviation of the scan drawn larger.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np

from pipeline.core.mesh import BoolArray, FloatArray, IndexArray, Mesh
from pipeline.report.chart import css
from pipeline.report.colormap import ColourScale
from pipeline.report.shots import round_below
from pipeline.report.words import ENGLISH, Words

#: Width of the window over the diagonal of the design, and over the deviation at the least. Chosen by hand.
WINDOW_SHARE, WINDOW_DEVIATIONS = 0.15, 6.0
#: Factors of the deviation, and the share of the window that it may take when it is drawn. Chosen by hand.
FACTORS, DRAWN_SHARE = (1, 2, 5, 10, 20, 50, 100), 0.15
#: Size of the drawing, points.
WIDTH, HEIGHT = 260.0, 180.0
#: Axes of the drawing (right, up) of a plane across x, y, z.
ACROSS = ((1, 2), (0, 2), (0, 1))
#: Saturation below which a colour is darkened, so that it shows on white.
PALE = 0.25


@dataclass(frozen=True, slots=True)
class Place:
    """Where to cut. position_mm : (3,) on the scan, frame of the design; value_mm : deviation there"""

    position_mm: FloatArray
    value_mm: float


def draw(
    place: Place, design: Mesh, scan: Mesh, signed_mm: FloatArray, scale: ColourScale, words: Words = ENGLISH
) -> tuple[str, bytes]:
    """Caption and SVG of the section through a place. scan : in the frame of the design; signed_mm : (n,) of
    its vertices
    """
    normal = normal_near(design, place.position_mm)
    axis = int(np.abs(normal).argmin())  # the plane has the normal in it: it shows the deviation in full
    window_mm = max(WINDOW_SHARE * design.diagonal_mm, WINDOW_DEVIATIONS * abs(place.value_mm))
    factor = max(
        (each for each in FACTORS if each * abs(place.value_mm) <= DRAWN_SHARE * window_mm), default=1
    )
    window = _Window(axis, place.position_mm, window_mm)
    ends, _ = _cut(design, design.vertices, window)
    parts = [window.lines(ends, "#000", 1.0)]
    if scan.is_cloud:
        parts.append(window.dots(scan.vertices, signed_mm, scale))
        factor = 1
    else:
        apart = _moved_apart(scan, signed_mm, window, factor, normal)
        ends, values = _cut(scan, apart, window, signed_mm)
        inks = np.array([_ink(colour) for colour in scale.colours(values)], dtype=np.str_)
        parts += [window.lines(ends[inks == ink], str(ink), 1.8) for ink in np.unique(inks)]
    parts.append(window.furniture())
    at = words.signed(float(place.position_mm[axis]), 2).removeprefix("+")
    caption = words(
        "{value} mm, plane {axis} = {at} mm; deviation drawn {factor} times; black: design, coloured: scan",
        value=words.signed(place.value_mm),
        axis="xyz"[axis],
        at=at,
        factor=factor,
    )
    head = (
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH:g} {HEIGHT:g}" width="{WIDTH:g}pt" '
        f'height="{HEIGHT:g}pt" font-family="DejaVu Sans, Verdana, sans-serif">'
    )
    return caption, (head + "".join(parts) + "</svg>\n").encode()


def normal_near(design: Mesh, position_mm: FloatArray) -> FloatArray:
    """(3,) of the design at its vertex nearest to a place, area-weighted over its triangles."""
    nearest = int(((design.vertices - position_mm) ** 2).sum(axis=1).argmin())
    around = design.faces[(design.faces == nearest).any(axis=1)]
    a, b, c = (design.vertices[around[:, corner]] for corner in range(3))
    cross = np.cross(b - a, c - a).sum(axis=0)
    return np.asarray(cross / max(float(np.linalg.norm(cross)), 1e-12), dtype=np.float64)


class _Window:
    """Around a place in the plane across an axis."""

    def __init__(self, axis: int, centre_mm: FloatArray, width_mm: float) -> None:
        self.axis, self.centre_mm, self.width_mm = axis, centre_mm, width_mm
        self._points_per_mm = WIDTH / width_mm

    def points(self, positions_mm: FloatArray) -> FloatArray:
        """(..., 2) of the drawing."""
        right, up = ACROSS[self.axis]
        x = WIDTH / 2 + (positions_mm[..., right] - self.centre_mm[right]) * self._points_per_mm
        y = HEIGHT / 2 - (positions_mm[..., up] - self.centre_mm[up]) * self._points_per_mm
        return np.stack([x, y], axis=-1)

    def lines(self, ends_mm: FloatArray, colour: str, width: float) -> str:
        """ends_mm : (k, 2, 3)"""
        path = "".join(f"M{a[0]:.1f} {a[1]:.1f}L{b[0]:.1f} {b[1]:.1f}" for a, b in self.points(ends_mm))
        pen = f'stroke="{colour}" stroke-width="{width:g}" stroke-linecap="round" fill="none"'
        return f'<path d="{path}" {pen}/>'

    def dots(self, positions_mm: FloatArray, signed_mm: FloatArray, scale: ColourScale) -> str:
        """Of a cloud: what lies in a slab as thick as its points lie apart."""
        off = np.abs(positions_mm - self.centre_mm)
        near = (off < self.width_mm).all(axis=1)
        thick_mm = 2 * self.width_mm / max(np.sqrt(near.sum()), 1.0)
        inside = near & (off[:, self.axis] < thick_mm / 2)
        at, colours = self.points(positions_mm[inside]), scale.colours(signed_mm[inside])
        return "".join(
            f'<circle cx="{x:.1f}" cy="{y:.1f}" r="2" fill="{_ink(colour)}"/>'
            for (x, y), colour in zip(at, colours, strict=True)
        )

    def furniture(self) -> str:
        """Frame, ring at the place, scale bar and axes."""
        length_mm = round_below(self.width_mm / 4)
        bar, y, right = length_mm * self._points_per_mm, HEIGHT - 9, WIDTH - 9
        across, up = ("xyz"[axis] for axis in ACROSS[self.axis])
        return (
            f'<rect x=".5" y=".5" width="{WIDTH - 1:g}" height="{HEIGHT - 1:g}" fill="none" '
            'stroke="#c9ced6"/>'
            f'<circle cx="{WIDTH / 2:g}" cy="{HEIGHT / 2:g}" r="6" fill="none" stroke="#c00a6e"/>'
            f'<path d="M{right - bar:.1f} {y - 4:g}v4H{right:g}v-4M10 {y - 24:g}V{y:g}H34" stroke="#000" '
            f'fill="none"/><text x="{right - bar / 2:.1f}" y="{y - 6:g}" font-size="8" text-anchor="middle">'
            f'{length_mm:g} mm</text><text x="38" y="{y + 2:g}" font-size="8">{across}</text>'
            f'<text x="7.5" y="{y - 28:g}" font-size="8">{up}</text>'
        )


def _near(mesh: Mesh, window: _Window) -> IndexArray:
    """(k,) faces with a corner in the window."""
    inside: BoolArray = np.asarray(
        (np.abs(mesh.vertices - window.centre_mm) < window.width_mm).all(axis=1), dtype=np.bool_
    )
    return np.flatnonzero(inside[mesh.faces].any(axis=1))


def _moved_apart(
    scan: Mesh, signed_mm: FloatArray, window: _Window, factor: float, outward: FloatArray
) -> FloatArray:
    """(n, 3) vertices of the scan, those near the place moved along their normals, so that their deviation is
    `factor` times as large. outward : (3,) normal of the design at the place
    """
    faces = scan.faces[_near(scan, window)]
    normals = np.zeros_like(scan.vertices)
    a, b, c = (scan.vertices[faces[:, corner]] for corner in range(3))
    for corner in range(3):
        np.add.at(normals, faces[:, corner], np.cross(b - a, c - a))
    lengths = np.linalg.norm(normals, axis=1)
    normals /= np.maximum(lengths, 1e-12)[:, None]
    used = np.flatnonzero(lengths > 0)
    closest = used[((scan.vertices[used] - window.centre_mm) ** 2).sum(axis=1).argmin()] if len(used) else 0
    side = 1.0 if float(normals[closest] @ outward) >= 0 else -1.0  # the design says what is outside
    return np.asarray(scan.vertices + side * (factor - 1) * signed_mm[:, None] * normals, dtype=np.float64)


def _cut(
    mesh: Mesh, drawn_mm: FloatArray, window: _Window, values: FloatArray | None = None
) -> tuple[FloatArray, FloatArray]:
    """(k, 2, 3) segments of the mesh in the plane near the place, drawn at `drawn_mm` (n, 3) instead of its
    vertices, and the mean of `values` (n,) on each.
    """
    import trimesh

    faces = mesh.faces[_near(mesh, window)]
    used, local_faces = np.unique(faces, return_inverse=True)
    nothing = np.zeros((0, 2, 3)), np.zeros(0)
    if not len(faces):
        return nothing
    local: Any = trimesh.Trimesh(mesh.vertices[used], local_faces.reshape(-1, 3), process=False)
    normal = np.eye(3)[window.axis]
    ends, numbers = trimesh.intersections.mesh_plane(local, normal, window.centre_mm, return_faces=True)
    if not len(ends):
        return nothing
    triangles, corners = np.asarray(local.triangles)[numbers], faces[numbers]
    drawn, means = np.empty_like(ends), np.zeros(len(ends))
    for end in (0, 1):
        weights = trimesh.triangles.points_to_barycentric(triangles, ends[:, end])
        drawn[:, end] = np.einsum("kc,kcd->kd", weights, drawn_mm[corners])
        if values is not None:
            means += (weights * values[corners]).sum(axis=1) / 2
    return drawn, means


def _ink(colour: FloatArray) -> str:
    """Neutral grey is darkened: it would not show on white."""
    is_pale = float(colour.max() - colour.min()) < PALE
    return css(0.6 * colour if is_pale else colour)
