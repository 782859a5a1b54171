"""Matching: hypotheses for the pose, from descriptors of landmarks and two independent sources, and landmark
matches.
"""

import numpy as np

from pipeline.core.landmark_set import LandmarkSet
from pipeline.core.mesh import FloatArray
from pipeline.core.settings import MatchingSettings
from pipeline.kernels import rigid
from pipeline.kernels.nearest import nearest
from pipeline.search.candidates import generate_candidates
from pipeline.search.hypotheses import HypothesisSearch
from pipeline.search.types import DescribedMesh, Hypothesis, Matching


def match(
    design: DescribedMesh,
    scan: DescribedMesh,
    length_mm: float,
    settings: MatchingSettings,
    seed: int,
    symmetries: tuple[FloatArray, ...] = (),
    approximate: tuple[FloatArray, ...] = (),
) -> Matching:
    """Hypotheses for T_design_scan, best first, and the landmarks that match under the best.

    A hypothesis comes from two corresponding oriented points (or principal axes) and is refined by short
    ICPs; the order is by truncated point-to-plane cost over points whose normals agree.

    length_mm : the length that descriptors, tolerances and shortest pairs are multiples of; symmetries,
    approximate : (4, 4) each, the design's own (`analysis.symmetry_group`), where they are known
    """
    search = HypothesisSearch(design.mesh, scan.mesh, settings, seed, symmetries, approximate)
    candidates = generate_candidates(
        design, scan, search.design_samples.points, search.scan_samples.points, length_mm, settings
    )
    hypotheses = search.run(candidates)
    return match_landmarks(
        design.landmarks, scan.landmarks, hypotheses, hypotheses[0].T_design_scan, length_mm
    )


def match_landmarks(
    design: LandmarkSet,
    scan: LandmarkSet,
    hypotheses: tuple[Hypothesis, ...],
    T_design_scan: FloatArray,
    length_mm: float,
) -> Matching:
    """Landmarks that are each other's nearest under `T_design_scan` (4, 4), within `length_mm`."""
    no_match = np.zeros(0, dtype=np.int64)
    q, p = design.position_mm, rigid.transformed(T_design_scan, scan.position_mm)
    if len(q) == 0 or len(p) == 0:
        return Matching(hypotheses, None, no_match, no_match)
    distance, to_design = nearest(q, p)
    _, to_scan = nearest(p, q)
    mutual = (to_scan[to_design] == np.arange(len(p))) & (distance <= length_mm)
    i = np.flatnonzero(mutual)
    j = to_design[i]
    T = rigid.fit(scan.position_mm[i], q[j]) if _spans_a_plane(q[j], length_mm) else None
    return Matching(hypotheses, T, j, i)


def _spans_a_plane(points: FloatArray, length_mm: float) -> bool:
    """Whether the points fix a rotation: three or more, and not within `length_mm` of one line."""
    if len(points) < 3:
        return False
    spread = np.linalg.svd(points - points.mean(axis=0), compute_uv=False) / np.sqrt(len(points))
    return bool(spread[1] > length_mm)
