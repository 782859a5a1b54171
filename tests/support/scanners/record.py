"""What a simulated scanner gives."""

from dataclasses import dataclass

import numpy as np

from pipeline.core.mesh import BoolArray, FloatArray, Mesh
from pipeline.kernels import rigid
from tests.support import shapes


@dataclass(frozen=True, slots=True)
class SimulatedScan:
    """mesh : the scan in its own frame, points where the scanner gives no surface; T_design_scan : (4, 4) the
    truth; accuracy_mm : 1 sigma of all that the scanner does to a point; is_part : (n,) false for what is
    none of the part
    """

    mesh: Mesh
    T_design_scan: FloatArray
    accuracy_mm: float
    is_part: BoolArray

    @classmethod
    def posed(cls, in_place: Mesh, accuracy_mm: float, rng: np.random.Generator) -> "SimulatedScan":
        """From a scan in the frame of the design, moved to a random pose."""
        T = shapes.motion(int(rng.integers(2**31)), translation_mm=in_place.diagonal_mm)
        is_part = np.ones(len(in_place.vertices), dtype=np.bool_)
        return cls(in_place.moved(T), rigid.inverse(T), accuracy_mm, is_part)


def random_direction(rng: np.random.Generator) -> FloatArray:
    """(3,) unit, uniform on the sphere."""
    direction = rng.normal(size=3)
    return np.asarray(direction / np.linalg.norm(direction))
