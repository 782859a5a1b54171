"""One colour per segment, the same in every file and picture of a job."""

import numpy as np

from pipeline.core.mesh import BoolArray, FloatArray, IntArray
from pipeline.stages.resample import Resampled
from pipeline.stages.segmentation import Segmentation

# The scheme "muted" of Paul Tol, Colour Schemes, SRON/EPS/TN/09-002 (2021): nine colours that are
# distinguishable with colour vision deficiency, in an order in which successive colours differ strongly. Its
# pale grey marks points without a segment.
_HEX = ("332288", "DDCC77", "CC6677", "44AA99", "882255", "88CCEE", "117733", "AA4499", "999933")
PALETTE: FloatArray = np.array([[int(code[k : k + 2], 16) / 255 for k in (0, 2, 4)] for code in _HEX])
PALE: FloatArray = np.full(3, 0xDD / 255)
#: Mixing ratio of PALE in the colour of halo vertices, in [0, 1]; low enough that segments remain visible
#: where nearly all vertices are halo. Chosen by hand, not fitted.
HALO_PALENESS = 0.5


def of_segment(segment: int) -> FloatArray:
    """(3,) RGB in [0, 1]; the colours repeat after nine segments."""
    colour: FloatArray = PALETTE[segment % len(PALETTE)]
    return colour


def of_vertices(labels: IntArray, halo: BoolArray) -> FloatArray:
    """(n, 3) RGB in [0, 1]: colour of each vertex's segment, paler in the halo. labels, halo : (n,)"""
    colours = PALETTE[labels % len(PALETTE)]
    colours[halo] += HALO_PALENESS * (PALE - colours[halo])
    return colours


def of_clean_vertices(segmentation: Segmentation, resampled: Resampled) -> FloatArray:
    """(n, 3) RGB in [0, 1] of the vertices of the cleaned mesh, from the nearest working vertex."""
    return of_vertices(segmentation.labels, segmentation.halo)[resampled.working_of_clean]
