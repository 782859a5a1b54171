// The closest point of a triangle.
#pragma once

#include <array>

namespace cusp {

using Vec = std::array<double, 3>;

inline Vec minus(const double* a, const double* b) { return {a[0] - b[0], a[1] - b[1], a[2] - b[2]}; }

inline double dot(const Vec& a, const Vec& b) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }

inline Vec cross(const Vec& a, const Vec& b) {
    return {a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]};
}

inline double ratio(double part, double whole) { return whole == 0 ? 0 : part / whole; }

// Barycentric weights of the point of triangle abc that is closest to p (Ericson, Real-Time Collision
// Detection, 2005, section 5.1.5). Weights of corners that do not belong to the closest feature are exactly
// 0: two at a vertex, one on an edge, none inside.
inline Vec weights_of_closest(const double* p, const double* a, const double* b, const double* c) {
    const Vec ab = minus(b, a), ac = minus(c, a), ap = minus(p, a), bp = minus(p, b), cp = minus(p, c);
    const double d1 = dot(ab, ap), d2 = dot(ac, ap), d3 = dot(ab, bp), d4 = dot(ac, bp), d5 = dot(ab, cp),
                 d6 = dot(ac, cp);
    if (d1 <= 0 && d2 <= 0) return {1, 0, 0};
    if (d3 >= 0 && d4 <= d3) return {0, 1, 0};
    if (d6 >= 0 && d5 <= d6) return {0, 0, 1};
    const double va = d3 * d6 - d5 * d4, vb = d5 * d2 - d1 * d6, vc = d1 * d4 - d3 * d2;
    if (vc <= 0 && d1 >= 0 && d3 <= 0) {
        const double on_ab = ratio(d1, d1 - d3);
        return {1 - on_ab, on_ab, 0};
    }
    if (vb <= 0 && d2 >= 0 && d6 <= 0) {
        const double on_ac = ratio(d2, d2 - d6);
        return {1 - on_ac, 0, on_ac};
    }
    if (va <= 0 && d4 >= d3 && d5 >= d6) {
        const double on_bc = ratio(d4 - d3, (d4 - d3) + (d5 - d6));
        return {0, 1 - on_bc, on_bc};
    }
    const double inside_b = ratio(vb, va + vb + vc), inside_c = ratio(vc, va + vb + vc);
    return {1 - inside_b - inside_c, inside_b, inside_c};
}

}  // namespace cusp
