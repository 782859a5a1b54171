"""One colour a segment, the same in every file and picture of a job."""

import numpy as np

from pipeline.core.mesh import BoolArray, FloatArray, IntArray
from pipeline.stages.resample import Resampled
from pipeline.stages.segmentation import Segmentation

# "muted" of Paul Tol, Colour Schemes, SRON/EPS/TN/09-002 (2021): nine that people who see colours differently
# tell apart, in an order that keeps neighbours in number far apart. Its pale grey is for what belongs
# nowhere.
_HEX = ("332288", "DDCC77", "CC6677", "44AA99", "882255", "88CCEE", "117733", "AA4499", "999933")
PALETTE: FloatArray = np.array([[int(code[k : k + 2], 16) / 255 for k in (0, 2, 4)] for code in _HEX])
PALE: FloatArray = np.full(3, 0xDD / 255)
HALO_PALENESS = 0.5  # how far towards PALE halo goes; where nearly all is halo, segments must still be seen


def of_segment(segment: int) -> FloatArray:
    """(3,) red, green, blue in [0, 1]; repeats after nine segments."""
    colour: FloatArray = PALETTE[segment % len(PALETTE)]
    return colour


def of_vertices(labels: IntArray, halo: BoolArray) -> FloatArray:
    """(n, 3) the colour of each vertex's segment, halo paler."""
    colours = PALETTE[labels % len(PALETTE)]
    colours[halo] += HALO_PALENESS * (PALE - colours[halo])
    return colours


def of_clean_vertices(segmentation: Segmentation, resampled: Resampled) -> FloatArray:
    """(n, 3) the colours of the vertices of the cleaned mesh, by the nearest vertex of the working mesh."""
    return of_vertices(segmentation.labels, segmentation.halo)[resampled.working_of_clean]
