"""A design known from a mesh, without a file."""

import numpy as np

from pipeline import Format
from pipeline.analysis.design_model import Design, known
from pipeline.core.mesh import Mesh
from pipeline.core.settings import Settings
from pipeline.core.timing import silent
from pipeline.stages.clean import Cleaned
from pipeline.stages.load import Loaded


def design_of(mesh: Mesh, settings: Settings) -> Design:
    cleaned = Cleaned(mesh, np.arange(len(mesh.vertices)), {})
    return known(Loaded(mesh, Format.PLY, "mm", 1.0, ""), cleaned, "", settings, silent(), 0)
