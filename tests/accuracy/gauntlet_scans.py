"""How a scan of a printed part is made for the gauntlet.

Another triangulation of the part (6,000 to 11,000 vertices, by the random generator), in a random pose, with
noise along its normals (Gaussian) and a smooth warp (one sine wave an axis, about one a diagonal), and for a
crop with what lies on one side of a random plane cut off. Every share is of the design's diagonal.
"""

from dataclasses import dataclass

import numpy as np

from pipeline.core.mesh import FloatArray, Mesh
from pipeline.core.settings import CleanSettings
from pipeline.kernels import rigid
from pipeline.stages.clean import clean
from pipeline.stages.resample import working_edge_mm
from tests.accuracy.gauntlet_specs import Condition
from tests.support import shapes
from tests.support.retriangulated import retriangulated


@dataclass(frozen=True, slots=True)
class Printed:
    """scan; T_design_scan; kept : what is left of the part, in place, without noise and warp; in_place :
    with them
    """

    scan: Mesh
    T_design_scan: FloatArray
    kept: Mesh
    in_place: Mesh


def printed(part: Mesh, size_mm: float, condition: Condition, rng: np.random.Generator) -> Printed:
    """A scan of a print of `part`; size_mm : what the condition's shares are of."""
    wanted = int(rng.integers(6_000, 11_000))
    area = float(part.face_areas_mm2().sum())
    copy = retriangulated(part, working_edge_mm(area, wanted))
    wave = rng.normal(size=(3, 3)) * 1.4 * np.pi / size_mm
    warp = (
        np.sin((copy.vertices - copy.vertices.mean(axis=0)) @ wave.T) * condition.warp * size_mm / np.sqrt(3)
    )
    noise = rng.normal(0, condition.noise * size_mm, len(copy.vertices))[:, None] * copy.vertex_normals()
    along = copy.vertices @ rng.normal(size=3)
    faces = copy.faces[(along >= np.quantile(along, condition.crop))[copy.faces].all(axis=1)]
    in_place = clean(Mesh(copy.vertices + warp + noise, faces), "scan", CleanSettings()).mesh
    T_scan_design = shapes.motion(int(rng.integers(2**31)), translation_mm=size_mm)
    return Printed(
        in_place.moved(T_scan_design), rigid.inverse(T_scan_design), Mesh(copy.vertices, faces), in_place
    )
