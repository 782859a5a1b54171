"""A design known from a mesh, without a file."""

import numpy as np

from pipeline import Format
from pipeline.design import Design, known
from pipeline.mesh import Mesh
from pipeline.settings import Settings
from pipeline.stages.clean import Cleaned
from pipeline.stages.load import Loaded
from pipeline.watch import silent


def design_of(mesh: Mesh, settings: Settings) -> Design:
    cleaned = Cleaned(mesh, np.arange(len(mesh.vertices)), {})
    return known(Loaded(mesh, Format.PLY, "mm", 1.0, ""), cleaned, "", settings, silent(), 0)
