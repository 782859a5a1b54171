"""Heat kernel signature: the heat that is still at a point a time t after all of it was put there.

Sun, Ovsjanikov, Guibas, "A concise and provably informative multi-scale signature based on heat diffusion"
(2009):

    k_t(x, x) = sum_i exp(-lambda_i t) phi_i(x)^2,   L phi_i = -lambda_i A phi_i

from the first 300 eigenpairs, for t from 4 ln 10 / lambda_300 to 4 ln 10 / lambda_2 (lambda_1 = 0): below,
pairs left out would count; above, nothing changes but the size. Feature points are local maxima in the 2-ring
"for a large t"; the paper names none, and a large t has only a few. Here every t is taken, halved from the
largest to the smallest, so that maxima of a larger t come before those of a smaller one.

L is the cotangent Laplacian, A the lumped mass. Every connected piece is a surface of its own, with the share
of the 300 pairs that its area has of the whole (Weyl: lambda_i is about 4 pi i / area), and its own range of
t.
"""

from dataclasses import dataclass

import numpy as np
import scipy.linalg
from scipy.sparse import csr_matrix, diags
from scipy.sparse.linalg import eigsh
from threadpoolctl import threadpool_limits

from pipeline.core.mesh import FloatArray, IntArray, Mesh
from pipeline.kernels import curvature

PAIRS = 300
DECAY = 4 * np.log(10)  # exp(-lambda t) = 1e-4
_MIN_AREA_SHARE = 1e-9  # of the mean vertex area: a sliver's corner has next to no mass
_SHIFT = -1e-2  # of 1 / area: beside the eigenvalue 0, where the shifted matrix can still be factorised
_ZERO = 1e-9  # of the greatest eigenvalue: less is the constant, or a piece that hangs together by slivers
_SMALL = 3  # times the pairs: below so many vertices a dense solver is faster, and always finds all


@dataclass(frozen=True, slots=True)
class Spectrum:
    """Of one connected piece. eigenvalues : (k,) 1/mm^2, rising from 0; functions : (n, k) 1/mm, sum A phi^2
    = 1
    """

    eigenvalues: FloatArray
    functions: FloatArray


def spectrum(laplacian: csr_matrix, areas: FloatArray, count: int) -> Spectrum:
    """The lowest `count` eigenpairs. laplacian : (n, n), negative semidefinite; areas : (n,) mm^2."""
    count = min(count, len(areas))
    total = float(areas.sum())
    mass = np.maximum(areas, _MIN_AREA_SHARE * total / len(areas)) / total  # of the piece scaled to area 1
    half = diags(1.0 / np.sqrt(mass))
    symmetric = csr_matrix(-(half @ laplacian @ half))
    with threadpool_limits(limits=1):  # dot products add up in the order of the threads
        if len(areas) <= _SMALL * count:
            values, vectors = scipy.linalg.eigh(symmetric.toarray(), subset_by_index=[0, count - 1])
        else:
            start = np.random.default_rng(0).random(len(areas))
            lanczos = min(len(areas), max(4 * count // 3, count + 20))
            values, vectors = eigsh(symmetric.tocsc(), k=count, sigma=_SHIFT, v0=start, ncv=lanczos, rng=0)
    order = np.argsort(values)
    functions = vectors[:, order] / np.sqrt(mass * total)[:, None]
    return Spectrum(np.maximum(values[order], 0.0) / total, functions)


def signature(found: Spectrum, times_mm2: FloatArray) -> FloatArray:
    """(n, s) k_t(x, x), 1/mm^2, at `times_mm2` (s,)."""
    fading = np.exp(-np.outer(found.eigenvalues, times_mm2))
    return np.asarray(np.einsum("nk,ks->ns", found.functions**2, fading), dtype=np.float64)


def signatures(mesh: Mesh, components: IntArray) -> FloatArray:
    """(n, s) k_t(x, x) times the area of the piece, so 1 where heat is spread evenly, at times halved from
    the largest.

    components : (n,) piece of each vertex. -inf on pieces smaller than one of the `PAIRS`: they have no
    detail here.
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
    shortest, longest = np.array([_range_mm2(found) for _, _, found in pieces]).T
    halvings = int(np.floor(np.log2(longest.max() / shortest.min()) + 1e-9))
    times = longest.max() / 2.0 ** np.arange(halvings + 1)
    fields = np.full((len(areas), len(times)), -np.inf)
    for (members, area, found), low, high in zip(pieces, shortest, longest, strict=True):
        fields[members] = area * signature(found, np.clip(times, low, high))
    return fields


def _range_mm2(found: Spectrum) -> tuple[float, float]:
    """The shortest and the longest t of the paper."""
    greatest = float(found.eigenvalues[-1])
    lowest = float(found.eigenvalues[found.eigenvalues > _ZERO * greatest].min(initial=greatest))
    return DECAY / greatest, DECAY / lowest
