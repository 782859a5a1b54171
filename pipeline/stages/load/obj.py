"""Wavefront OBJ."""

from pipeline.core.formats import Format
from pipeline.core.settings import LoadSettings
from pipeline.stages.load.by_trimesh import read_by_trimesh
from pipeline.stages.load.contents import Contents


def read_obj(data: bytes, settings: LoadSettings) -> Contents:
    """The polygons of an OBJ, as triangles."""
    return read_by_trimesh(data, Format.OBJ)
