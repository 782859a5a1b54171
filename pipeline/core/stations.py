"""Where a scanner stood, and which points it measured from there."""

from dataclasses import dataclass

import numpy as np

from pipeline.core.mesh import FloatArray, IndexArray, IntArray


@dataclass(frozen=True, slots=True, eq=False)
class Stations:
    """positions_mm : (s, 3), frame of the scan; of_vertex : (n,) station that each vertex of the scan was
    measured from, -1 where the file does not say
    """

    positions_mm: FloatArray
    of_vertex: IntArray

    @classmethod
    def of_points(cls, points_mm: FloatArray, positions_mm: FloatArray, of_vertex: IntArray) -> "Stations":
        """The stations of `points_mm` (n, 3), without those that lie in the box of what they measured.

        A file of merged scans says that its scanner stood at the origin, which is in the part where the part
        lies there; and a scanner in a part is beyond what the test of visibility can judge.
        """
        of_vertex = of_vertex.copy()
        for station, position in enumerate(positions_mm):
            own = points_mm[of_vertex == station]
            if not len(own) or ((own.min(axis=0) <= position) & (position <= own.max(axis=0))).all():
                of_vertex[of_vertex == station] = -1
        return cls(positions_mm, of_vertex)

    @property
    def any(self) -> bool:
        """Whether the station of any vertex is known."""
        return bool((self.of_vertex >= 0).any())

    def chosen(self, old_of_new: IndexArray) -> "Stations":
        """Of a mesh of these vertices (m,); -1 of a vertex that is new."""
        return Stations(self.positions_mm, np.where(old_of_new < 0, -1, self.of_vertex[old_of_new]))

    def scaled(self, factor: float) -> "Stations":
        """Of the scan in another unit."""
        return Stations(self.positions_mm * factor, self.of_vertex)
