"""Where the scan shows a surface that the design's own material would hide: the floor under a rib that is not
there. From there to the scanner there was air, so what the design has in front of it is missing.

Each place of the scan looks out along its normal. On a right part the way leads through air; here it starts
in material, and leads through it for three visible distances at least, deeper in it than noise explains.
"""

import numpy as np

from pipeline.core.mesh import BoolArray, FloatArray
from pipeline.kernels.surface_patches import Patch, adjacency_of, largest_patch
from pipeline.stages.registration import Fit
from pipeline.verification.chord_errors import ChordErrors
from pipeline.verification.placed_scan import PlacedScan
from pipeline.verification.thresholds import DIFFERENCE

#: Steps along the normal, in visible distances, from the place itself: across a narrow gap there is material
#: too. Chosen by hand.
STEPS = (0.0, 1.0, 2.0, 3.0)


def seen_through_patch(scan: PlacedScan, surfaces: ChordErrors, signed_mm: FloatArray) -> Patch | None:
    """The largest patch of the scan, in the design's frame, that lies behind material of the design; its
    value is the depth in that material. None for a cloud, which has no normals of its own.

    signed_mm : (n,) of the vertices of the scan, + outside the design
    """
    design, visible_mm = surfaces.design, surfaces.visible_mm
    if scan.surface is None:
        return None
    fit: Fit = scan.fit
    outward = scan.normal_sign * np.einsum("kj,ij->ki", scan.mesh.vertex_normals(), fit.T_design_scan[:3, :3])
    rows = np.arange(len(fit.moved))
    depth_mm = np.zeros(len(rows))
    for step in STEPS:
        points = fit.moved[rows] + step * visible_mm * outward[rows]
        closest = design.closest(points)
        depth = -design.signed_distance(points, closest)
        # beyond the open border of a design there is no inside
        inside = (depth > DIFFERENCE.min_depth_ratio * visible_mm) & ~design.on_open_border(closest)
        rows = rows[inside]
        depth_mm[rows] = np.maximum(depth_mm[rows], depth[inside])
    behind = np.zeros(len(depth_mm), dtype=np.bool_)
    behind[rows] = True
    near = adjacency_of(scan.mesh)  # its second power bridges a vertex that noise lifts
    min_area_mm2 = DIFFERENCE.min_through_share * float(design.mesh.face_areas_mm2().sum())

    def patch_of(chosen: BoolArray) -> Patch | None:
        patch = largest_patch(fit.moved, near @ near, scan.mesh.vertex_areas_mm2(), depth_mm, chosen)
        return patch if patch is not None and patch.area_mm2 >= min_area_mm2 else None

    if patch_of(behind) is None:
        return None
    return patch_of(behind & ~surfaces.explain_scan(fit.closest.face, signed_mm))
