"""Points as text: a line for each, its coordinates first."""

import io
import re
import warnings

import numpy as np

from pipeline.core.errors import UnreadableFile
from pipeline.core.mesh import FloatArray
from pipeline.core.settings import LoadSettings
from pipeline.stages.load.contents import Body, Contents


def read_point_text(data: bytes, settings: LoadSettings) -> Contents:
    """The points of a text, one a line."""
    return Contents((Body.cloud(_points(data)),))


def _points(data: bytes) -> FloatArray:
    text = re.sub(rb"[,;]", b" ", data).decode("utf-8", errors="replace")
    first = text.lstrip("\ufeff").split("\n", 1)[0].split("#")[0].split()
    try:
        [float(word) for word in first]
        header_lines = 0
    except ValueError:
        header_lines = 1
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # "input contained no data": reported below
            points = np.loadtxt(
                io.StringIO(text), comments=["#", "//"], usecols=(0, 1, 2), skiprows=header_lines, ndmin=2
            )
    except ValueError as error:
        raise UnreadableFile(
            "a line of the XYZ file is not three numbers",
            remedy="write one point on each line: x y z; further columns are ignored",
        ) from error
    if len(points) == 0:
        raise UnreadableFile("the XYZ file has no points")
    return points
