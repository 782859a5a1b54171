"""The landmarks of one mesh, as the landmarks stage leaves them and matching takes them."""

from dataclasses import dataclass

from pipeline.core.mesh import FloatArray, IndexArray


@dataclass(frozen=True, slots=True)
class LandmarkSet:
    """Landmarks of one mesh, strongest first, in that mesh's own frame.

    vertex : (k,) nearest vertex of the working mesh; position_mm, normal : (k, 3); segment, t2, strength :
    (k,);
    t2_all : (n,) T^2 of every working vertex, 0 where none was computed; limit_share : share beyond the T^2
    limit
    """

    vertex: IndexArray
    position_mm: FloatArray
    normal: FloatArray
    segment: IndexArray
    t2: FloatArray
    strength: FloatArray
    t2_all: FloatArray
    limit_share: float
