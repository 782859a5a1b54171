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


def four_views(mesh: Mesh) -> list[View]:
    """Views of both flat sides of the part and two oblique views, along its principal axes."""
    weights = mesh.weights()
    centred = mesh.vertices - np.average(mesh.vertices, axis=0, weights=weights)
    _, axes = np.linalg.eigh(np.einsum("k,ki,kj->ij", weights, centred, centred))
    flat, middle, long = axes.T  # ascending
    flat, middle = (axis * np.sign(axis[np.abs(axis).argmax()]) for axis in (flat, middle))
    long = np.cross(middle, flat)
    return [
        View.along("from above", flat, middle),
        View.along("from below", -flat, middle),
        View.along("oblique, front", 0.55 * flat - 0.8 * middle + 0.3 * long, flat),
        View.along("oblique, back", 0.55 * flat + 0.8 * middle - 0.3 * long, flat),
    ]


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
    """PNG of the mesh. colours : (n, 3) RGB in [0, 1] of the vertices; frame : (k, 3) mm, points that must
    all be in the picture; width, height : pixels; landmarks_mm : (m, 3) points on the surface, drawn as dots
    where they are visible
    """
    in_view = frame @ view.axes.T
    low, high = in_view.min(axis=0), in_view.max(axis=0)
    centre = (low + high) / 2
    mm_per_px = MARGIN * max((high[0] - low[0]) / width, (high[1] - low[1]) / height, 1e-9)
    if mesh.is_cloud:
        image = _splatted(mesh.vertices @ view.axes.T, colours, centre, mm_per_px, width, height)
    else:
        image = _drawn(mesh, colours, view, centre, mm_per_px, width, height, landmarks_mm)
    return png(image)


def png(image: FloatArray) -> bytes:
    """PNG of `image` (h, w, 3), RGB in [0, 1]."""
    from PIL import Image  # a dependency of matplotlib; imported only when a picture is drawn

    stream = io.BytesIO()
    pixels = Image.fromarray(np.rint(255 * np.clip(image, 0, 1)).astype(np.uint8))
    pixels.save(stream, "PNG", compress_level=PNG_LEVEL)
    return stream.getvalue()


def _drawn(
    mesh: Mesh,
    colours: FloatArray,
    view: View,
    centre: FloatArray,
    mm_per_px: float,
    width: int,
    height: int,
    landmarks_mm: FloatArray | None,
) -> FloatArray:
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
    return np.asarray(total / OVERSAMPLE**2, dtype=np.float64)


def _splatted(
    in_view: FloatArray, colours: FloatArray, centre: FloatArray, mm_per_px: float, width: int, height: int
) -> FloatArray:
    image = np.full((height, width, 3), BACKGROUND)
    order = np.argsort(in_view[:, 2], kind="stable")  # the points nearest to the viewer are drawn last
    column = np.rint((in_view[order, 0] - centre[0]) / mm_per_px + (width - 1) / 2).astype(np.int64)
    row = np.rint((centre[1] - in_view[order, 1]) / mm_per_px + (height - 1) / 2).astype(np.int64)
    half = POINT_PX // 2
    for down in range(-half, half + 1):
        for across in range(-half, half + 1):
            r, c = row + down, column + across
            inside = (r >= 0) & (r < height) & (c >= 0) & (c < width)
            image[r[inside], c[inside]] = colours[order][inside]
    return image
