"""A design known from a mesh, without a file."""

import numpy as np

from pipeline import Format
from pipeline.analysis.design_model import Design, known
from pipeline.core.mesh import Mesh
from pipeline.core.settings import Settings
from pipeline.core.timing import silent
from pipeline.stages.clean import Cleaned
from pipeline.stages.load import Loaded

_KNOWN: dict[bytes, Design] = {}


def design_of(mesh: Mesh, settings: Settings) -> Design:
    """What is known of a design; the same mesh and settings are analysed once a process."""
    key = mesh.vertices.tobytes() + mesh.faces.tobytes() + settings.model_dump_json().encode()
    if key not in _KNOWN:
        cleaned = Cleaned(mesh, np.arange(len(mesh.vertices)), {})
        loaded = Loaded(mesh, Format.PLY, "mm", 1.0, "")
        _KNOWN[key] = known(loaded, cleaned, "", settings, silent(), 0)
    return _KNOWN[key]
