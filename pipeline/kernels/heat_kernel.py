"""Heat kernel signature: the share of a unit of heat that remains at its source point after the time t.

Sun, Ovsjanikov, Guibas, "A concise and provably informative multi-scale signature based on heat diffusion"
(2009):

    k_t(x, x) = sum_i exp(-lambda_i t) phi_i(x)^2,   L phi_i = -lambda_i A phi_i

from the first 300 eigenpairs, for t from 4 ln 10 / lambda_300 to 4 ln 10 / lambda_2 (lambda_1 = 0). For
smaller t the missing eigenpairs would matter; for larger t only the magnitude changes. The paper's feature
points are the local maxima in the 2-ring "for a large t", without a value of t; a large t has only a few
maxima. Here t is halved from the largest to the smallest value, and the maxima of a larger t rank before
those of a smaller one.

L is the cotangent Laplacian, A the lumped mass. Each connected piece is treated as a separate surface. Its
share of the 300 eigenpairs is its share of the area (Weyl: lambda_i is about 4 pi i / area), and it has its
own range of t.
"""

from dataclasses import dataclass

import numpy as np
import scipy.linalg
from scipy.sparse import csr_matrix, diags
from scipy.sparse.linalg import eigsh
from threadpoolctl import threadpool_limits

from pipeline.core.mesh import FloatArray, IntArray, Mesh
from pipeline.kernels import curvature

#: Eigenpairs of the whole mesh; from literature (Sun et al. 2009).
PAIRS = 300
#: lambda t at the ends of the range of t, where exp(-lambda t) = 1e-4, no unit; from literature (Sun et al.
#: 2009).
DECAY = 4 * np.log(10)
#: Smallest mass of a vertex, as a share of the mean vertex area. Chosen by hand, not fitted.
_MIN_AREA_SHARE = 1e-9
#: Shift of the eigenvalue solver, in 1 / area: close to the eigenvalue 0, but the shifted matrix can be
#: factorised. Chosen by hand, not fitted.
_SHIFT = -1e-2
#: Eigenvalues below this share of the largest one count as 0: the constant function, or parts that are
#: connected by degenerate triangles only. Chosen by hand, not fitted.
_ZERO = 1e-9
#: Vertices per eigenpair up to which the dense solver is used: it is faster there and always finds every
#: pair. Chosen by hand, not fitted.
_DENSE_LIMIT = 3
#: Margin of the number of halvings of t against rounding.
_ROUNDING_MARGIN = 1e-9


@dataclass(frozen=True, slots=True)
class Spectrum:
    """Eigenpairs of one connected piece.

    eigenvalues : (k,) 1/mm^2, ascending from 0; functions : (n, k) 1/mm, normalised to sum A phi^2 = 1
    """

    eigenvalues: FloatArray
    functions: FloatArray


def spectrum(laplacian: csr_matrix, areas: FloatArray, count: int) -> Spectrum:
    """The `count` smallest eigenpairs. laplacian : (n, n), negative semidefinite; areas : (n,) mm^2"""
    count = min(count, len(areas))
    total = float(areas.sum())
    mass = np.maximum(areas, _MIN_AREA_SHARE * total / len(areas)) / total  # on the piece scaled to area 1
    half = diags(1.0 / np.sqrt(mass))
    symmetric = csr_matrix(-(half @ laplacian @ half))
    with threadpool_limits(limits=1):  # the order of summation depends on the threads
        if len(areas) <= _DENSE_LIMIT * count:
            values, vectors = scipy.linalg.eigh(symmetric.toarray(), subset_by_index=[0, count - 1])
        else:
            start = np.random.default_rng(0).random(len(areas))
            lanczos = min(len(areas), max(4 * count // 3, count + 20))
            values, vectors = eigsh(symmetric.tocsc(), k=count, sigma=_SHIFT, v0=start, ncv=lanczos, rng=0)
    order = np.argsort(values)
    functions = vectors[:, order] / np.sqrt(mass * total)[:, None]
    return Spectrum(np.maximum(values[order], 0.0) / total, functions)


def signature(spectrum: Spectrum, times_mm2: FloatArray) -> FloatArray:
    """(n, s) k_t(x, x), 1/mm^2, at the times `times_mm2` (s,)."""
    decay = np.exp(-np.outer(spectrum.eigenvalues, times_mm2))
    return np.asarray(np.einsum("nk,ks->ns", spectrum.functions**2, decay), dtype=np.float64)


def signatures(mesh: Mesh, components: IntArray) -> FloatArray:
    """(n, s) k_t(x, x) times the area of the piece, no unit, for s times, each half of the one before.

    The value is 1 where the heat is spread evenly. components : (n,) connected piece of each vertex. Pieces
    whose share of the area is less than 1 / `PAIRS` get -inf.
    """
    areas = mesh.vertex_areas_mm2()
    total = float(areas.sum())
    laplacian = curvature.cotangent_laplacian(mesh)
    pieces = []
    by_piece = np.argsort(components, kind="stable")
    for members in np.split(by_piece, np.flatnonzero(np.diff(components[by_piece])) + 1):
        area = float(areas[members].sum())
        if len(members) >= 3 and area * PAIRS >= total > 0:
            count = max(2, int(np.ceil(PAIRS * area / total)))
            pieces.append((members, area, spectrum(laplacian[members][:, members], areas[members], count)))
    if not pieces:
        return np.full((len(areas), 1), -np.inf)
    shortest, longest = np.array([_range_mm2(piece) for _, _, piece in pieces]).T
    halvings = int(np.floor(np.log2(longest.max() / shortest.min()) + _ROUNDING_MARGIN))
    times = longest.max() / 2.0 ** np.arange(halvings + 1)
    fields = np.full((len(areas), len(times)), -np.inf)
    for (members, area, piece), low, high in zip(pieces, shortest, longest, strict=True):
        fields[members] = area * signature(piece, np.clip(times, low, high))
    return fields


def _range_mm2(spectrum: Spectrum) -> tuple[float, float]:
    """The shortest and the longest t of the paper, mm^2."""
    largest = float(spectrum.eigenvalues[-1])
    smallest = float(spectrum.eigenvalues[spectrum.eigenvalues > _ZERO * largest].min(initial=largest))
    return DECAY / largest, DECAY / smallest
