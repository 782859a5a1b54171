"""A design model made from a mesh, and a mesh as the input of a job, without a file."""

import numpy as np

from pipeline import Format
from pipeline.analysis.design_model import DesignModel, build_design
from pipeline.analysis.inputs import InputMesh
from pipeline.core.mesh import Mesh
from pipeline.core.settings import Settings
from pipeline.core.timing import silent
from pipeline.stages.clean import Cleaned
from pipeline.stages.load import Loaded

_ANALYSED: dict[bytes, DesignModel] = {}


def design_of(mesh: Mesh, settings: Settings) -> DesignModel:
    """The model of a design; the same mesh and settings are analysed once in a process."""
    key = mesh.vertices.tobytes() + mesh.faces.tobytes() + settings.model_dump_json().encode()
    if key not in _ANALYSED:
        _ANALYSED[key] = build_design(input_of(mesh, "design"), "", settings, silent(), 0)
    return _ANALYSED[key]


def input_of(mesh: Mesh, name: str) -> InputMesh:
    """The mesh as if it had been read from a file in mm. name : `design` or `scan`"""
    cleaned = Cleaned(mesh, np.arange(len(mesh.vertices)), {})
    return InputMesh(name, Loaded(mesh, Format.PLY, "mm", 1.0, ""), cleaned)
