"""A simulator of scanners: what a depth camera, structured light, a dental scanner and CT make of a part.

Each takes the part (mm, in the frame of its design) and a random generator, and gives a `SimulatedScan` in
another pose. The same generator gives the same bytes.
"""

from tests.support.scanners.ct import ct
from tests.support.scanners.dental import dental_scanner
from tests.support.scanners.depth_camera import Camera, depth_camera
from tests.support.scanners.record import SimulatedScan
from tests.support.scanners.structured_light import structured_light
from tests.support.scanners.surroundings import SURROUNDINGS, with_surroundings

__all__ = [
    "SURROUNDINGS",
    "Camera",
    "SimulatedScan",
    "ct",
    "dental_scanner",
    "depth_camera",
    "structured_light",
    "with_surroundings",
]
