"""Where a mesh is marked: T^2 and what it is compared with, behind one setting, `landmarks.detector`.

A detector answers with candidates in order of strength; `stages/landmarks.py` takes from them what lies away from
open borders and from stronger ones.
"""

from collections.abc import Callable
from dataclasses import dataclass

from pipeline.kernels.geodesics import GeodesicSolver
from pipeline.mesh import FloatArray, IndexArray, Mesh
from pipeline.settings import Detector
from pipeline.stages.features import Features


@dataclass(frozen=True, slots=True)
class Scene:
    """What a detector may look at: the working mesh, distances along its surface, the features of its vertices.

    count : points that will be asked of it; spacing_mm : least distance they will have; seed : of random draws
    """

    mesh: Mesh
    surface: GeodesicSolver
    features: Features
    count: int
    spacing_mm: float
    seed: int


@dataclass(frozen=True, slots=True)
class Candidates:
    """vertex : (k,) of the working mesh, best first; strength : (k,) what they are ordered by, falling"""

    vertex: IndexArray
    strength: FloatArray


Detect = Callable[[Scene], Candidates]
COMPETITORS: dict[Detector, Detect] = {}
