"""Which point of a triangle is closest, worked out by numpy."""

import numpy as np

from pipeline.core.mesh import FloatArray


def closest_weights(points: FloatArray, corners: FloatArray) -> FloatArray:
    """The independent route to what `native/closest.cpp` computes: (k, 3) barycentric weights of the point of
    triangle `corners` (k, 3, 3) closest to `points` (k, 3).

    Weights are exactly 0 off the closest feature: two zeros at a vertex, one on an edge, none inside
    (Ericson, Real-Time Collision Detection, 2005, section 5.1.5).
    """
    a, b, c = corners[:, 0], corners[:, 1], corners[:, 2]
    ab, ac, ap, bp, cp = b - a, c - a, points - a, points - b, points - c

    def dot(u: FloatArray, v: FloatArray) -> FloatArray:
        product: FloatArray = np.einsum("kd,kd->k", u, v)
        return product

    d1, d2, d3, d4, d5, d6 = dot(ab, ap), dot(ac, ap), dot(ab, bp), dot(ac, bp), dot(ab, cp), dot(ac, cp)
    va, vb, vc = d3 * d6 - d5 * d4, d5 * d2 - d1 * d6, d1 * d4 - d3 * d2

    def ratio(part: FloatArray, whole: FloatArray) -> FloatArray:
        quotient: FloatArray = np.divide(part, whole, out=np.zeros_like(part), where=whole != 0)
        return quotient

    zero, one = np.zeros_like(va), np.ones_like(va)
    on_ab, on_ac = ratio(d1, d1 - d3), ratio(d2, d2 - d6)
    on_bc = ratio(d4 - d3, (d4 - d3) + (d5 - d6))
    inside_b, inside_c = ratio(vb, va + vb + vc), ratio(vc, va + vb + vc)
    regions = [
        ((d1 <= 0) & (d2 <= 0), (one, zero, zero)),
        ((d3 >= 0) & (d4 <= d3), (zero, one, zero)),
        ((d6 >= 0) & (d5 <= d6), (zero, zero, one)),
        ((vc <= 0) & (d1 >= 0) & (d3 <= 0), (1 - on_ab, on_ab, zero)),
        ((vb <= 0) & (d2 >= 0) & (d6 <= 0), (1 - on_ac, zero, on_ac)),
        ((va <= 0) & (d4 >= d3) & (d5 >= d6), (zero, 1 - on_bc, on_bc)),
    ]
    conditions = [condition for condition, _ in regions]
    inside = (1 - inside_b - inside_c, inside_b, inside_c)
    return np.stack(
        [np.select(conditions, [weights[k] for _, weights in regions], inside[k]) for k in range(3)], axis=1
    )
