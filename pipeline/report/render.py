"""Pictures of a coloured mesh or point cloud, rendered on the CPU without a display: by a z-buffer
(`kernels/raster.py`).
"""

import io
from dataclasses import dataclass

import numpy as np

from pipeline.core.mesh import FloatArray, Mesh
from pipeline.kernels import raster

# All values of the rendering are chosen by hand, not fitted; none affects a measurement.
#: Grey value of the background, in [0, 1].
BACKGROUND = 1.0
#: Share of the ambient light, in [0, 1].
AMBIENT = 0.35
#: Size of the picture over the size of its content.
MARGIN = 1.06
#: zlib level of the pictures: two thirds of the time of the default, and 6 % larger.
PNG_LEVEL = 3
#: Samples per pixel along each axis.
OVERSAMPLE = 2
#: Side of the square of a point of a point cloud, pixels.
POINT_PX = 3
#: Colour of the backs of the faces of an open surface, RGB in [0, 1], and its share in what is drawn; as on
#: the page (`service/web/geometry.js`).
BACK_COLOUR, BACK_SHARE = np.array([0.28, 0.31, 0.36]), 0.75
#: Colour of the design under the points of a cloud, RGB in [0, 1]; how far (share of the picture's width) a
#: point may lie below it and still be drawn.
UNDER_COLOUR, UNDER_SHARE = np.array([0.55, 0.59, 0.65]), 0.01
#: Radius of a landmark, pixels, and its colour, RGB in [0, 1].
DOT_PX = 3.5
DOT_COLOUR = np.array([0.08, 0.08, 0.08])


@dataclass(frozen=True, slots=True)
class View:
    """An orthographic view. axes : (3, 3) orthonormal rows, which point right, up, and towards the viewer"""

    name: str
    axes: FloatArray

    @classmethod
    def along(cls, name: str, towards_eye: FloatArray, up: FloatArray) -> "View":
        z = towards_eye / np.linalg.norm(towards_eye)
        x = np.cross(up, z)
        x = x / np.linalg.norm(x)
        return cls(name, np.stack([x, np.cross(z, x), z]))


@dataclass(frozen=True, slots=True)
class Framing:
    """Where a picture shows what. centre : (3,) in the frame of the view; width, height : pixels"""

    view: View
    centre: FloatArray
    mm_per_px: float
    width: int
    height: int

    @classmethod
    def of(cls, view: View, frame: FloatArray, width: int, height: int, foot: int = 0) -> "Framing":
        """All points of `frame` (k, 3) mm are inside the picture, `foot` pixels above its lower edge."""
        in_view = frame @ view.axes.T
        low, high = in_view.min(axis=0), in_view.max(axis=0)
        mm_per_px = MARGIN * max((high[0] - low[0]) / width, (high[1] - low[1]) / (height - foot), 1e-9)
        centre = (low + high) / 2
        centre[1] -= foot / 2 * mm_per_px
        return cls(view, centre, float(mm_per_px), width, height)

    def pixel(self, point: FloatArray) -> tuple[float, float, float]:
        """Column, row and height (mm, towards the viewer) of a point (3,)."""
        at = self.view.axes @ point
        column = (at[0] - self.centre[0]) / self.mm_per_px + (self.width - 1) / 2
        return float(column), float((self.centre[1] - at[1]) / self.mm_per_px + (self.height - 1) / 2), at[2]


@dataclass(frozen=True, slots=True)
class Rendered:
    """image : (h, w, 3) RGB in [0, 1]; depth : (h', w') mm towards the viewer, -inf where nothing is; finer
    than the image by a whole factor; None for a point cloud
    """

    framing: Framing
    image: FloatArray
    depth: FloatArray | None

    def shows(self, point: FloatArray, slack_mm: float) -> bool:
        """Whether no surface hides a point (3,) by more than `slack_mm`; True of a cloud."""
        if self.depth is None:
            return True
        column, row, height = self.framing.pixel(point)
        factor = self.depth.shape[1] // self.framing.width
        at_row, at_column = (
            int(np.clip(round(factor * x), 0, size - 1))
            for x, size in zip((row, column), self.depth.shape, strict=True)
        )
        return bool(self.depth[at_row, at_column] <= height + slack_mm)


def picture(
    mesh: Mesh,
    colours: FloatArray,
    view: View,
    frame: FloatArray,
    width: int,
    height: int,
    *,
    landmarks_mm: FloatArray | None = None,
) -> bytes:
    """PNG of `rendered`."""
    framing = Framing.of(view, frame, width, height)
    return png(rendered(mesh, colours, framing, landmarks_mm=landmarks_mm).image)


def rendered(
    mesh: Mesh,
    colours: FloatArray,
    framing: Framing,
    *,
    landmarks_mm: FloatArray | None = None,
    fronts: int = 0,
    under: Mesh | None = None,
) -> Rendered:
    """The mesh. colours : (n, 3) RGB in [0, 1] of the vertices; landmarks_mm : (m, 3) points on the surface,
    drawn as dots where they are visible; fronts : 1 shades the backs of the faces, -1 their fronts, 0
    neither; under : of a cloud, the surface that hides what lies behind it
    """
    if mesh.is_cloud:
        return _splatted(mesh.vertices @ framing.view.axes.T, colours, framing, under)
    if fronts:
        mesh, colours = _with_backs(mesh, colours, framing.view, fronts)
    return Rendered(framing, *_drawn(mesh, colours, framing, landmarks_mm))


def _with_backs(mesh: Mesh, colours: FloatArray, view: View, fronts: int) -> tuple[Mesh, FloatArray]:
    """The faces that show their back have vertices of their own, of another colour."""
    is_back = fronts * (mesh.face_cross_mm2() @ view.axes[2]) < 0
    faces = mesh.faces + (len(mesh.vertices) * is_back[:, None]).astype(mesh.faces.dtype)
    backs = (1 - BACK_SHARE) * colours + BACK_SHARE * BACK_COLOUR
    return Mesh(np.concatenate([mesh.vertices, mesh.vertices]), faces), np.concatenate([colours, backs])


def png(image: FloatArray) -> bytes:
    """PNG of `image` (h, w, 3), RGB in [0, 1]."""
    from PIL import Image  # a dependency of matplotlib; imported only when a picture is drawn

    stream = io.BytesIO()
    pixels = Image.fromarray(np.rint(255 * np.clip(image, 0, 1)).astype(np.uint8))
    pixels.save(stream, "PNG", compress_level=PNG_LEVEL)
    return stream.getvalue()


def _drawn(
    mesh: Mesh, colours: FloatArray, framing: Framing, landmarks_mm: FloatArray | None
) -> tuple[FloatArray, FloatArray]:
    view, centre, mm_per_px = framing.view, framing.centre, framing.mm_per_px
    width, height = framing.width, framing.height
    w, h, step = width * OVERSAMPLE, height * OVERSAMPLE, mm_per_px / OVERSAMPLE
    left, top = float(centre[0] - (w - 1) / 2 * step), float(centre[1] + (h - 1) / 2 * step)
    image, depth = raster.draw(
        *(mesh.vertices @ view.axes.T, mesh.faces, colours),
        left=left,
        top=top,
        step=step,
        size_px=(w, h),
        ambient=AMBIENT,
        background=BACKGROUND,
    )
    if landmarks_mm is not None and len(landmarks_mm):
        x, y = left + step * np.arange(w), top - step * np.arange(h)
        reach, radius_mm = int(np.ceil(DOT_PX * OVERSAMPLE)) + 1, DOT_PX * mm_per_px
        for landmark in landmarks_mm @ view.axes.T:
            column, row = round((landmark[0] - left) / step), round((top - landmark[1]) / step)
            rows = slice(max(row - reach, 0), max(row + reach + 1, 0))
            columns = slice(max(column - reach, 0), max(column + reach + 1, 0))
            # A surface point near the landmark belongs to its dot, so hidden landmarks remain hidden.
            lateral = np.hypot(*np.meshgrid(x[columns] - landmark[0], y[rows] - landmark[1]))
            near_landmark = np.hypot(lateral, depth[rows, columns] - landmark[2]) <= radius_mm
            image[rows, columns][near_landmark] = DOT_COLOUR
    # Rows first, then columns: numpy is slow along short axes.
    flat = image[::OVERSAMPLE].copy()
    for i in range(1, OVERSAMPLE):
        flat += image[i::OVERSAMPLE]
    total = flat[:, ::OVERSAMPLE].copy()
    for j in range(1, OVERSAMPLE):
        total += flat[:, j::OVERSAMPLE]
    return np.asarray(total / OVERSAMPLE**2, dtype=np.float64), depth


def _splatted(in_view: FloatArray, colours: FloatArray, framing: Framing, under: Mesh | None) -> Rendered:
    centre, mm_per_px, width, height = framing.centre, framing.mm_per_px, framing.width, framing.height
    image, depth = np.full((height, width, 3), BACKGROUND), None
    if under is not None:
        image, depth = _drawn(under, np.tile(UNDER_COLOUR, (len(under.vertices), 1)), framing, None)
    column = np.rint((in_view[:, 0] - centre[0]) / mm_per_px + (width - 1) / 2).astype(np.int64)
    row = np.rint((centre[1] - in_view[:, 1]) / mm_per_px + (height - 1) / 2).astype(np.int64)
    shown = (row >= 0) & (row < height) & (column >= 0) & (column < width)
    if depth is not None:
        at = depth[OVERSAMPLE * row.clip(0, height - 1), OVERSAMPLE * column.clip(0, width - 1)]
        shown &= in_view[:, 2] > at - UNDER_SHARE * width * mm_per_px
    order = np.flatnonzero(shown)
    order = order[np.argsort(in_view[order, 2], kind="stable")]  # the nearest to the viewer are drawn last
    half = POINT_PX // 2
    for down in range(-half, half + 1):
        for across in range(-half, half + 1):
            r, c = row[order] + down, column[order] + across
            inside = (r >= 0) & (r < height) & (c >= 0) & (c < width)
            image[r[inside], c[inside]] = colours[order][inside]
    return Rendered(framing, image, depth)
