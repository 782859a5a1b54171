// Candidate poses: which two correspondences agree, and which poses are distinct; see kernels/poses.py.
#include <nanobind/stl/tuple.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <stdexcept>
#include <tuple>
#include <vector>

#include "bridge.hpp"
#include "motion.hpp"
#include "point_tree.hpp"
#include "rows.hpp"
#include "triangle.hpp"

namespace nb = nanobind;
using namespace nb::literals;

namespace {

using cusp::cross;
using cusp::dot;
using cusp::In1;
using cusp::In2;
using cusp::Matrices;
using cusp::minus;
using cusp::Motion;
using cusp::Out1;
using cusp::Point;
using cusp::row;
using cusp::Vec;

double norm(const Vec& v) { return std::sqrt(dot(v, v)); }

Vec sum(const Vec& a, const Vec& b) { return {a[0] + b[0], a[1] + b[1], a[2] + b[2]}; }

// Two correspondences p -> q with normals n -> m agree when the distances between their points, the angles
// between their normals, and the angles of the normals to the connecting line are similar.
struct Correspondences {
    const In2<double>&p, &n, &q, &m;
    double length_tolerance, min_length, max_angle_cos, min_tilt;

    // How badly i and j agree, or -1 where they do not
    double disagreement(int64_t i, int64_t j) const {
        const Vec d_scan = minus(row(p, j).data(), row(p, i).data()),
                  d_design = minus(row(q, j).data(), row(q, i).data());
        const double l_scan = norm(d_scan), l_design = norm(d_design);
        const double length_error = std::abs(l_scan - l_design);
        if (!(length_error <= length_tolerance) || std::min(l_scan, l_design) < min_length) return -1;
        const Vec u{d_scan[0] / l_scan, d_scan[1] / l_scan, d_scan[2] / l_scan},
            v{d_design[0] / l_design, d_design[1] / l_design, d_design[2] / l_design};
        const Vec ni = row(n, i), nj = row(n, j), mi = row(m, i), mj = row(m, j);
        const double worst = std::max({std::abs(dot(ni, nj) - dot(mi, mj)), std::abs(dot(ni, u) - dot(mi, v)),
                                       std::abs(dot(nj, u) - dot(mj, v))});
        if (!(worst <= max_angle_cos)) return -1;
        // Summed normals along the line leave the frame undefined.
        if (!(std::min(norm(cross(sum(ni, nj), u)), norm(cross(sum(mi, mj), v))) > min_tilt)) return -1;
        return worst / max_angle_cos + length_error / length_tolerance;
    }
};

// Pairs i < j of correspondences that agree, by i, then j: i, j, and how badly (0 is best).
std::tuple<Out1<int64_t>, Out1<int64_t>, Out1<double>> agreeing_pairs(
    const In2<double>& p, const In2<double>& n, const In2<double>& q, const In2<double>& m,
    double length_tolerance, double min_length, double max_angle_cos, double min_tilt, int threads) {
    const auto count = static_cast<int64_t>(p.shape(0));
    for (const auto* each : {&p, &n, &q, &m})
        cusp::check_rows(*each, p.shape(0), "points and normals must be (c, 3), of one length");
    threads = cusp::checked_threads(threads);
    if (!(min_length > 0)) throw std::invalid_argument("min_length must be above 0");
    struct Pair {
        int64_t j;
        double how_badly;
    };
    std::vector<std::vector<Pair>> of(count);
    std::vector<int64_t> first, second;
    std::vector<double> how_badly;
    {
        const nb::gil_scoped_release no_gil;
        const Correspondences all{p, n, q, m, length_tolerance, min_length, max_angle_cos, min_tilt};
        cusp::for_each(count, threads, {}, [&](int, int64_t i) {
            for (int64_t j = i + 1; j < count; ++j) {
                const double found = all.disagreement(i, j);
                if (found >= 0) of[i].push_back({j, found});
            }
        });
        for (int64_t i = 0; i < count; ++i)
            for (const auto& [j, found] : of[i])
                first.push_back(i), second.push_back(j), how_badly.push_back(found);
    }
    return {cusp::to_numpy(std::move(first)), cusp::to_numpy(std::move(second)),
            cusp::to_numpy(std::move(how_badly))};
}

// Numbers of the poses that differ from each that was kept before by at least `apart` (RMS over the probes),
// also after every motion of `group`; at most `most`. Poses of different sign are different.
Out1<int64_t> distinct(const Matrices& T, const In1<double>& sign, const In2<double>& probes, double apart,
                       int64_t most, const Matrices& group) {
    cusp::check_rows(probes, probes.shape(0), "probes must be (k, 3)");
    cusp::check_finite(T, "T");
    cusp::check_finite(group, "group");
    if (sign.shape(0) != T.shape(0)) throw std::invalid_argument("one sign a pose");
    const auto count = static_cast<int64_t>(T.shape(0)), k = static_cast<int64_t>(probes.shape(0)),
               images = static_cast<int64_t>(group.shape(0));
    std::vector<int64_t> kept;
    {
        const nb::gil_scoped_release no_gil;
        const double limit = apart * apart * static_cast<double>(k);
        std::vector<Point> taken, placed(k);  // of each kept pose the probes under each motion of the group
        std::vector<double> taken_sign;
        for (int64_t number = 0; number < count && static_cast<int64_t>(kept.size()) < most; ++number) {
            const Motion motion = Motion::of(T.data() + 16 * number);
            for (int64_t i = 0; i < k; ++i) placed[i] = motion(row(probes, i));
            bool is_new = true;
            for (size_t other = 0; is_new && other < taken_sign.size(); ++other) {
                if (taken_sign[other] != sign.data()[number]) continue;
                double squared = 0;
                for (int64_t i = 0; i < k && squared < limit; ++i)
                    squared += cusp::distance_sq(placed[i], taken[k * other + i]);
                is_new = !(squared < limit);
            }
            if (!is_new) continue;
            kept.push_back(number);
            for (int64_t g = 0; g < images; ++g) {
                const Motion image = Motion::of(group.data() + 16 * g);
                for (int64_t i = 0; i < k; ++i) taken.push_back(image(placed[i]));
                taken_sign.push_back(sign.data()[number]);
            }
        }
    }
    return cusp::to_numpy(std::move(kept));
}

}  // namespace

void bind_poses(nb::module_& m) {
    m.def("agreeing_pairs", &agreeing_pairs, "p"_a, "n"_a, "q"_a, "m"_a, "length_tolerance"_a, "min_length"_a,
          "max_angle_cos"_a, "min_tilt"_a, "threads"_a);
    m.def("distinct", &distinct, "T"_a, "sign"_a, "probes"_a, "apart"_a, "most"_a, "group"_a);
}
