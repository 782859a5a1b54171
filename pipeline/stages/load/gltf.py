"""Binary glTF (GLB)."""

from dataclasses import replace

from pipeline.core.formats import Format
from pipeline.core.settings import LoadSettings
from pipeline.stages.load.by_trimesh import read_by_trimesh
from pipeline.stages.load.contents import Contents


def read_glb(data: bytes, settings: LoadSettings) -> Contents:
    """The meshes of a GLB, which are in metres."""
    return replace(read_by_trimesh(data, Format.GLB), unit="meter")
