// Exact closest point on a known triangle for many points; the ray caster has found the triangle.
#include <nanobind/stl/tuple.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <stdexcept>
#include <vector>

#include "bridge.hpp"

namespace nb = nanobind;
using namespace nb::literals;

namespace {

using cusp::In1;
using cusp::In2;
using cusp::Out1;
using cusp::Out2;
using cusp::to_numpy;
using Vec = std::array<double, 3>;

Vec minus(const double* a, const double* b) { return {a[0] - b[0], a[1] - b[1], a[2] - b[2]}; }

double dot(const Vec& a, const Vec& b) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }

double ratio(double part, double whole) { return whole == 0 ? 0 : part / whole; }

// Barycentric weights of the point of triangle abc that is closest to p (Ericson, Real-Time Collision
// Detection, 2005, section 5.1.5). Weights of corners that do not belong to the closest feature are exactly
// 0: two at a vertex, one on an edge, none inside.
Vec weights_of_closest(const double* p, const double* a, const double* b, const double* c) {
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

Out2<double> rows_of_three(std::vector<double>&& values) {
    auto* owned = new std::vector<double>(std::move(values));
    const nb::capsule owner(owned, [](void* p) noexcept { delete static_cast<std::vector<double>*>(p); });
    return Out2<double>(owned->data(), {owned->size() / 3, 3}, owner);
}

// For each point (k, 3) and its face (k,): the closest point (k, 3), its barycentric weights (k, 3), the
// distance (k,).
std::tuple<Out2<double>, Out2<double>, Out1<double>> closest_on_faces(const In2<double>& points,
                                                                      const In2<double>& vertices,
                                                                      const In2<int32_t>& faces,
                                                                      const In1<int64_t>& face, int threads) {
    if (points.shape(1) != 3 || vertices.shape(1) != 3 || faces.shape(1) != 3)
        throw std::invalid_argument("points, vertices and faces must have three columns");
    const auto count = static_cast<int64_t>(points.shape(0));
    if (face.shape(0) != points.shape(0)) throw std::invalid_argument("points and face must have one length");
    for (int64_t i = 0; i < count; ++i)
        if (face.data()[i] < 0 || face.data()[i] >= static_cast<int64_t>(faces.shape(0)))
            throw std::out_of_range("face out of range");
    std::vector<double> closest(3 * count), weights(3 * count), distance(count);
    const auto project = [&](int64_t i) {
        const double* p = points.data() + 3 * i;
        const int32_t* corner = faces.data() + 3 * face.data()[i];
        const double *a = vertices.data() + 3 * corner[0], *b = vertices.data() + 3 * corner[1],
                     *c = vertices.data() + 3 * corner[2];
        const Vec w = weights_of_closest(p, a, b, c);
        double squared = 0;
        for (int k = 0; k < 3; ++k) {
            const double x = w[0] * a[k] + w[1] * b[k] + w[2] * c[k];
            closest[3 * i + k] = x;
            weights[3 * i + k] = w[k];
            squared += (p[k] - x) * (p[k] - x);
        }
        distance[i] = std::sqrt(squared);
    };
    {
        const nb::gil_scoped_release no_gil;
        if (threads <= 1) {
            for (int64_t i = 0; i < count; ++i) project(i);
        } else {
            cusp::for_each(count, threads, {}, [&](int, int64_t i) { project(i); }, 4096);
        }
    }
    return {rows_of_three(std::move(closest)), rows_of_three(std::move(weights)),
            to_numpy(std::move(distance))};
}

}  // namespace

void bind_closest(nb::module_& m) {
    m.def("closest_on_faces", &closest_on_faces, "points"_a, "vertices"_a, "faces"_a, "face"_a, "threads"_a);
}
