// Fast point feature histograms (Rusu, Blodow & Beetz, "Fast point feature histograms (FPFH) for 3D
// registration", 2009) of every point, in the layout of Open3D: 11 bins for each of theta, alpha and phi.
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <numbers>
#include <numeric>
#include <stdexcept>
#include <vector>

#include "bridge.hpp"
#include "checks.hpp"
#include "cell_grid.hpp"
#include "triangle.hpp"

namespace nb = nanobind;
using namespace nb::literals;

namespace {

using cusp::CellGrid;
using cusp::cross;
using cusp::dot;
using cusp::In1;
using cusp::In2;
using cusp::Out2;
using cusp::Vec;

constexpr int kBins = 11, kWidth = 3 * kBins;
constexpr std::array<int, 3> kDegenerate{kBins / 2, kBins / 2, kBins / 2};  // all angles 0
constexpr double kTotal = 100.0;  // the bins of one angle sum to this (Open3D)

// The bin of theta = atan2(y, x): of 11 equal sectors from -pi to pi. Comparing with their borders takes an
// eighth of the time of an arc tangent.
int sector(double y, double x) {
    static const auto borders = [] {
        std::array<std::array<double, 2>, kBins / 2> found;  // above the x axis; those below mirror them
        for (int k = 0; k < kBins / 2; ++k) {
            const double angle = (2 * k + 1) * std::numbers::pi / kBins;
            found[k] = {std::cos(angle), std::sin(angle)};
        }
        return found;
    }();
    const double height = std::abs(y);
    int passed = 0;
    for (const auto& [c, s] : borders) passed += c * height - s * x >= 0;
    return kBins / 2 + (std::signbit(y) ? -passed : passed);
}

int bin(double share) {
    return static_cast<int>(std::min(std::max(0.0, std::floor(kBins * share)), kBins - 1.0));  // also of NaN
}

// The bins of theta, alpha and phi of two oriented points (equations 1 to 3); `line` leads from the source.
std::array<int, 3> bins_of(const Vec& line, const Vec& source, const Vec& target, double phi) {
    Vec v = cross(line, source);
    const double v_length = std::sqrt(dot(v, v));
    if (v_length == 0) return kDegenerate;
    for (double& each : v) each /= v_length;
    const Vec w = cross(source, v);
    return {sector(dot(w, target), dot(source, target)), bin((dot(v, target) + 1) / 2), bin((phi + 1) / 2)};
}

struct PairBins {
    std::array<int, 3> seen_from_p, seen_from_q;
};

// The source is the point whose normal has the smaller angle with the line between both, whichever of the two
// is looked at; where the angles are equal, it is the one looked at.
PairBins bins_of_pair(const double* p, const double* np, const double* q, const double* nq) {
    const Vec line{q[0] - p[0], q[1] - p[1], q[2] - p[2]}, back{-line[0], -line[1], -line[2]};
    const Vec at_p{np[0], np[1], np[2]}, at_q{nq[0], nq[1], nq[2]};
    const double length = std::sqrt(dot(line, line));
    if (length == 0) return {kDegenerate, kDegenerate};
    const double cosine_p = dot(at_p, line) / length, cosine_q = dot(at_q, line) / length;
    if (std::abs(cosine_p) == std::abs(cosine_q))
        return {bins_of(line, at_p, at_q, cosine_p), bins_of(back, at_q, at_p, -cosine_q)};
    const auto bins = std::abs(cosine_p) > std::abs(cosine_q) ? bins_of(line, at_p, at_q, cosine_p)
                                                              : bins_of(back, at_q, at_p, -cosine_q);
    return {bins, bins};
}

// (k, 33) histograms at the points of the numbers `at` (k,), of `points` (n, 3) with unit `normals` (n, 3),
// over the neighbours nearer than `radius`.
Out2<double> fpfh(const In2<double>& points, const In2<double>& normals, const In1<int64_t>& at,
                  double radius, int threads) {
    cusp::check_rows(points, points.shape(0), "points must be (n, 3)");
    cusp::check_rows(normals, points.shape(0), "normals must be (n, 3), as the points");
    if (!(radius > 0)) throw std::invalid_argument("radius must be above 0");
    cusp::check_finite(radius, "radius");
    threads = cusp::checked_threads(threads);
    const auto n = static_cast<int64_t>(points.shape(0));
    const auto asked = static_cast<int64_t>(at.shape(0));
    cusp::check_indices(at, n, "point");
    const double *p = points.data(), *normal = normals.data();
    std::vector<double> simple(kWidth * n), full(kWidth * asked);
    {
        const nb::gil_scoped_release no_gil;
        const CellGrid grid(p, n, radius);
        // Each pair is computed once. Counts are whole numbers: their sum over the threads is the same in any
        // order.
        std::vector<std::vector<int32_t>> counts(threads, std::vector<int32_t>(kWidth * n));
        cusp::for_each(n, threads, {}, [&](int worker, int64_t i) {
            auto& mine = counts[worker];
            grid.for_each_near(i, [&](int64_t j, double) {
                if (j < i) return;
                const auto bins = bins_of_pair(p + 3 * i, normal + 3 * i, p + 3 * j, normal + 3 * j);
                for (int64_t angle = 0; angle < 3; ++angle) {
                    ++mine[kWidth * i + angle * kBins + bins.seen_from_p[angle]];
                    ++mine[kWidth * j + angle * kBins + bins.seen_from_q[angle]];
                }
            });
        });
        for (int64_t i = 0; i < n; ++i) {
            std::array<int32_t, kWidth> sum{};
            for (const auto& each : counts)
                for (int k = 0; k < kWidth; ++k) sum[k] += each[kWidth * i + k];
            const int32_t neighbours = std::accumulate(sum.begin(), sum.begin() + kBins, 0);
            for (int k = 0; neighbours > 0 && k < kWidth; ++k)
                simple[kWidth * i + k] = sum[k] * (kTotal / neighbours);
        }
        cusp::for_each(asked, threads, {}, [&](int, int64_t number) {
            const int64_t i = at.data()[number];
            std::array<double, kWidth> sum{};
            grid.for_each_near(i, [&](int64_t j, double distance_sq) {
                if (distance_sq == 0) return;
                const double* other = simple.data() + kWidth * j;
                for (int k = 0; k < kWidth; ++k) sum[k] += other[k] / distance_sq;
            });
            for (int angle = 0; angle < 3; ++angle) {
                double total = 0;
                for (int k = angle * kBins; k < (angle + 1) * kBins; ++k) total += sum[k];
                for (int k = angle * kBins; k < (angle + 1) * kBins; ++k)
                    full[kWidth * number + k] =
                        (total == 0 ? 0 : sum[k] * (kTotal / total)) + simple[kWidth * i + k];
            }
        });
    }
    auto* owned = new std::vector<double>(std::move(full));
    const nb::capsule owner(owned,
                            [](void* memory) noexcept { delete static_cast<std::vector<double>*>(memory); });
    return Out2<double>(owned->data(), {static_cast<size_t>(asked), kWidth}, owner);
}

}  // namespace

void bind_fpfh(nb::module_& m) {
    m.def("fpfh", &fpfh, "points"_a, "normals"_a, "at"_a, "radius"_a, "threads"_a);
}
