"""Where the scan shows a surface that the design's own material would hide: the floor under a rib that is not
there. From there to the scanner there was air, so what the design has in front of it is missing.

Each place of the scan looks out along its normal; of a cloud, to where its scanner stood, where the file
says so. On a right part the way leads through air; here it starts in material, and leads through it for three
visible distances at least, deeper in it than noise explains.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.sparse import coo_matrix, csr_matrix

from pipeline.core.mesh import BoolArray, FloatArray, IndexArray
from pipeline.kernels import rigid, topology
from pipeline.kernels.nearest import nearest
from pipeline.kernels.surface import Surface
from pipeline.kernels.surface_patches import Patch, largest_patch
from pipeline.verification.placed_scan import PlacedScan
from pipeline.verification.thresholds import DIFFERENCE

#: Steps along the way out, in visible distances, from the place itself: across a narrow gap there is material
#: too. Chosen by hand.
STEPS = (0.0, 1.0, 2.0, 3.0)


@dataclass(frozen=True, slots=True, eq=False)
class _Looking:
    """points, outward : (k, 3) places of the scan and unit vectors to the air before them, frame of the
    design; ends : (e, 2) which of them are neighbours; areas_mm2 : (k,) of the scan that each stands for
    """

    points: FloatArray
    outward: FloatArray
    ends: IndexArray
    areas_mm2: FloatArray


def seen_through_patch(
    scan: PlacedScan,
    design: Surface,
    visible_mm: float,
    explained: Callable[[], BoolArray] | None = None,
) -> Patch | None:
    """The largest patch of the scan, in the design's frame, that lies behind material of the design; its
    value is the depth in that material. None for a cloud whose file does not say where its scanner stood.

    explained : (n,) the vertices of the scan that only chords lie off (`ChordErrors.explain_scan`), asked for
    where there is a patch
    """
    looking = (
        _towards_scanner(scan) if scan.surface is None else _along_normals(scan, scan.surface.edges.ends)
    )
    if looking is None:
        return None
    rows = np.arange(len(looking.points))
    depth_mm = np.zeros(len(rows))
    for step in STEPS:
        points = looking.points[rows] + step * visible_mm * looking.outward[rows]
        closest = design.closest(points)
        depth = -design.signed_distance(points, closest)
        # beyond the open border of a design there is no inside
        inside = (depth > DIFFERENCE.min_depth_ratio * visible_mm) & ~design.on_open_border(closest)
        rows = rows[inside]
        depth_mm[rows] = np.maximum(depth_mm[rows], depth[inside])
    behind = np.zeros(len(depth_mm), dtype=np.bool_)
    behind[rows] = True
    min_area_mm2 = DIFFERENCE.min_through_share * float(design.mesh.face_areas_mm2().sum())

    def patch_of(chosen: BoolArray) -> Patch | None:
        at = np.flatnonzero(chosen)
        near = _neighbours(looking.ends, at, len(chosen))
        two_steps = near @ near.T  # they bridge a place that noise lifts
        every = np.ones(len(at), dtype=np.bool_)
        patch = largest_patch(looking.points[at], two_steps, looking.areas_mm2[at], depth_mm[at], every)
        return patch if patch is not None and patch.area_mm2 >= min_area_mm2 else None

    found = patch_of(behind)
    if found is None or explained is None or scan.surface is None:  # places of a cloud are no vertices
        return found
    return patch_of(behind & ~explained())


def _neighbours(ends: IndexArray, rows: IndexArray, count: int) -> csr_matrix:
    """(k, count) 1 where an edge leads from a place in `rows` (k,) to another, and at the place itself.

    ends : (e, 2) of the edges
    """
    number = np.full(count, -1)
    number[rows] = np.arange(len(rows))
    both = np.concatenate([ends, ends[:, ::-1]])
    both = both[number[both[:, 0]] >= 0]
    i = np.concatenate([number[both[:, 0]], np.arange(len(rows))])
    j = np.concatenate([both[:, 1], rows])
    return coo_matrix((np.ones(len(i)), (i, j)), shape=(len(rows), count)).tocsr()


def _along_normals(scan: PlacedScan, ends: IndexArray) -> _Looking:
    rotation = scan.fit.T_design_scan[:3, :3]
    outward = scan.normal_sign * np.einsum("kj,ij->ki", scan.mesh.vertex_normals(), rotation)
    return _Looking(scan.fit.moved, outward, ends, scan.mesh.vertex_areas_mm2())


def _towards_scanner(scan: PlacedScan) -> _Looking | None:
    """The measured point nearest to each vertex of the working mesh, which says what is near it."""
    if scan.stations is None or not scan.stations.any:
        return None
    known = np.flatnonzero(scan.stations.of_vertex >= 0)
    _, chosen = nearest(scan.mesh.vertices[known], scan.working.vertices)
    points = scan.fit.moved[known[chosen]]
    positions = rigid.transformed(scan.fit.T_design_scan, scan.stations.positions_mm)
    way = positions[scan.stations.of_vertex[known[chosen]]] - points
    outward = way / np.maximum(np.linalg.norm(way, axis=1, keepdims=True), 1e-300)
    return _Looking(points, outward, topology.edges(scan.working.faces).ends, scan.working.vertex_areas_mm2())
