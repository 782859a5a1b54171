"""A design model made from a mesh, without a file."""

import numpy as np

from pipeline import Format
from pipeline.analysis.design_model import DesignModel, build_design
from pipeline.analysis.inputs import InputMesh
from pipeline.core.mesh import Mesh
from pipeline.core.settings import Settings
from pipeline.core.timing import silent
from pipeline.stages.clean import Cleaned
from pipeline.stages.load import Loaded


def design_of(mesh: Mesh, settings: Settings) -> DesignModel:
    cleaned = Cleaned(mesh, np.arange(len(mesh.vertices)), {})
    source = InputMesh("design", Loaded(mesh, Format.PLY, "mm", 1.0, ""), cleaned)
    return build_design(source, "", settings, silent(), 0)
