"""Orthographic pictures of a coloured mesh by a z-buffer (`native/raster.cpp`)."""

import os

import numpy as np
import numpy.typing as npt

from pipeline.core.mesh import FloatArray, IntArray
from pipeline.kernels.native import core


def draw(
    vertices: FloatArray,
    faces: IntArray,
    colours: FloatArray,
    *,
    left: float,
    top: float,
    step: float,
    size_px: tuple[int, int],
    ambient: float,
    background: float,
) -> tuple[npt.NDArray[np.float32], FloatArray]:
    """The samples at x = left + column * step, y = top - row * step, each lit from the viewer (Lambert).

    vertices : (n, 3) mm in the frame of the view (right, up, towards the viewer); faces : (m, 3); colours :
    (n, 3) RGB in [0, 1]; left, top, step : mm; size_px : width and height; ambient : share of the light that
    comes from everywhere; background : grey value where there is no surface

    Returns
    -------
    image : (h, w, 3) RGB, float32; depth : (h, w) mm, towards the viewer, -inf where there is no surface.
    The same bits with any number of threads.
    """
    image, depth = core.picture(
        np.ascontiguousarray(vertices, dtype=np.float64),
        faces,
        np.ascontiguousarray(colours, dtype=np.float64),
        left,
        top,
        step,
        size_px[0],
        size_px[1],
        ambient,
        background,
        len(os.sched_getaffinity(0)),
    )
    return np.asarray(image), np.asarray(depth)
