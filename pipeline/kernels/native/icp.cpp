// Point-to-plane ICP from many start poses, to samples and to the exact surface; see kernels/icp.py and
// kernels/surface.py. Poses run on threads; all sums of one pose run on one thread, in the order of the
// points.
#include <nanobind/stl/tuple.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>
#include <vector>

#include "best_rotation.hpp"
#include "bridge.hpp"
#include "plane_step.hpp"
#include "point_tree.hpp"
#include "rows.hpp"
#include "spatial_order.hpp"
#include "surface_tree.hpp"

namespace nb = nanobind;
using namespace nb::literals;

namespace {

using cusp::check_rows;
using cusp::checked_threads;
using cusp::Correspondence;
using cusp::In1;
using cusp::In2;
using cusp::Matrices;
using cusp::matrices;
using cusp::Motion;
using cusp::Out1;
using cusp::Out2;
using cusp::OutMatrices;
using cusp::Point;
using cusp::PointTree;
using cusp::row;
using cusp::rows_of_three;
using cusp::SurfacePoint;
using cusp::SurfaceTree;
using cusp::to_numpy;
using cusp::Vec;

// Which correspondences count, and how a step is damped.
struct Rules {
    double max_distance, min_agreement, damping;
};

void check_poses(const Matrices& T, const In1<double>& normal_sign) {
    if (normal_sign.shape(0) != T.shape(0)) throw std::invalid_argument("one normal sign a pose");
    cusp::check_finite(T, "T");
}

class SampleTarget {
   public:
    SampleTarget(const In2<double>& points, const In2<double>& normals)
        : tree_(checked(points, normals), static_cast<int32_t>(points.shape(0))) {
        for (int32_t slot = 0; slot < tree_.size(); ++slot)
            normals_.push_back(row(normals, tree_.number(slot)));
    }

    // A fixed number of steps from every pose: T (h, 4, 4), and the mean squared residual (h,), truncated at
    // the largest distance.
    std::tuple<OutMatrices, Out1<double>> refine(const In2<double>& points, const In2<double>& normals,
                                                 const Matrices& T, const In1<double>& normal_sign,
                                                 double max_distance, double min_agreement, double damping,
                                                 int iterations, int threads) const {
        check_rows(points, points.shape(0), "points must be (k, 3)");
        check_rows(normals, points.shape(0), "normals must be (k, 3), as the points");
        const auto poses = static_cast<int64_t>(T.shape(0));
        check_poses(T, normal_sign);
        threads = checked_threads(threads);
        const Rules rules{max_distance, min_agreement, damping};
        std::vector<double> refined(16 * poses), cost(poses);
        {
            const nb::gil_scoped_release no_gil;
            std::vector<std::vector<Correspondence>> pairs(threads);
            std::vector<std::vector<int32_t>> slots(threads);
            cusp::for_each(
                poses, threads, {},
                [&](int worker, int64_t pose) {
                    Motion motion = Motion::of(T.data() + 16 * pose);
                    slots[worker].assign(points.shape(0), -1);
                    for (int k = 0; k < iterations; ++k) {
                        match(points, normals, motion, normal_sign.data()[pose], rules, slots[worker],
                              pairs[worker]);
                        motion = plane_step(pairs[worker], damping, max_distance).after(motion);
                    }
                    match(points, normals, motion, normal_sign.data()[pose], rules, slots[worker],
                          pairs[worker]);
                    cost[pose] = mean_cost(pairs[worker], max_distance);
                    motion.write(refined.data() + 16 * pose);
                },
                1);
        }
        return {matrices(std::move(refined)), to_numpy(std::move(cost))};
    }

   private:
    static const double* checked(const In2<double>& points, const In2<double>& normals) {
        check_rows(points, points.shape(0), "points must be (k, 3)");
        check_rows(normals, points.shape(0), "normals must be (k, 3), as the points");
        return points.data();
    }

    void match(const In2<double>& points, const In2<double>& normals, const Motion& motion, double sign,
               const Rules& rules, std::vector<int32_t>& slots, std::vector<Correspondence>& pairs) const {
        const auto count = static_cast<int64_t>(points.shape(0));
        pairs.resize(count);
        for (int64_t i = 0; i < count; ++i) {
            const Point moved = motion(row(points, i));
            const int32_t slot =
                tree_.nearest_within(moved, slots[i], rules.max_distance * rules.max_distance);
            pairs[i] = {moved, moved, {}, 0};
            if (slot < 0) continue;
            slots[i] = slot;
            const Vec turned = cusp::rotated(motion.R, row(normals, i));
            pairs[i].q = tree_.point(slot);
            pairs[i].n = normals_[slot];
            pairs[i].w = sign * cusp::dot(turned, normals_[slot]) > rules.min_agreement;
        }
    }

    static double mean_cost(const std::vector<Correspondence>& pairs, double max_distance) {
        const double most = max_distance * max_distance;
        double sum = 0;
        for (const auto& each : pairs) {
            const double residual = cusp::dot(each.n, cusp::minus(each.q.data(), each.p.data()));
            sum += each.w > 0 ? std::min(residual * residual, most) : most;
        }
        return sum / static_cast<double>(pairs.size());
    }

    PointTree tree_;
    std::vector<Vec> normals_;  // by slot
};

// Points from which it pays to visit them in spatial order: the face of the last point is near the next
// one's, and the triangles are in the cache. Chosen by hand; affects only the time.
constexpr int64_t kManyPoints = 20'000;

class SurfaceTarget {
   public:
    SurfaceTarget(const In2<double>& vertices, const In2<int32_t>& faces)
        : tree_(checked(vertices, faces), faces.data(), static_cast<int32_t>(faces.shape(0))) {}

    // The closest point of the surface (k, 3), its face (k,), its barycentric weights (k, 3), the distance
    // (k,). near : (k,) a face for each point that is likely near; it affects only the time
    std::tuple<Out2<double>, Out1<int64_t>, Out2<double>, Out1<double>> closest(
        const In2<double>& points, const std::optional<In1<int64_t>>& near, int threads) const {
        check_rows(points, points.shape(0), "points must be (k, 3)");
        if (near) check_near(*near, points.shape(0));
        threads = checked_threads(threads);
        const auto count = static_cast<int64_t>(points.shape(0));
        std::vector<double> point(3 * count), weights(3 * count), distance(count);
        std::vector<int64_t> face(count);
        {
            const nb::gil_scoped_release no_gil;
            const bool sorted = !near && count >= kManyPoints;
            const std::vector<int32_t> order =
                sorted ? cusp::spatial_order(points.data(), count) : std::vector<int32_t>();
            in_blocks(count, threads, [&](int64_t first, int64_t last) {
                int32_t guess = -1;  // the last point's face
                for (int64_t k = first; k < last; ++k) {
                    const int64_t i = sorted ? order[k] : k;
                    if (near) guess = static_cast<int32_t>(near->data()[i]);
                    const SurfacePoint found = tree_.closest(points.data() + 3 * i, guess);
                    guess = found.face;
                    face[i] = found.face;
                    distance[i] = std::sqrt(found.distance_sq);
                    std::copy(found.point.begin(), found.point.end(), point.begin() + 3 * i);
                    std::copy(found.weights.begin(), found.weights.end(), weights.begin() + 3 * i);
                }
            });
        }
        return {rows_of_three(std::move(point)), to_numpy(std::move(face)), rows_of_three(std::move(weights)),
                to_numpy(std::move(distance))};
    }

    // ICP to convergence from every pose: T (h, 4, 4), converged (h,) 0 or 1, iterations (h,).
    std::tuple<OutMatrices, Out1<uint8_t>, Out1<int32_t>> refine(
        const In2<double>& points, const std::optional<In2<double>>& normals, const In1<double>& weights,
        const Matrices& T, const In1<double>& normal_sign, double max_distance, double start_factor,
        double decay, double min_agreement, double damping, int min_pairs, int iterations, double tolerance,
        double stall_share, int stall_iterations, int threads) const {
        check_rows(points, weights.shape(0), "points must be (k, 3), one weight each");
        if (normals) check_rows(*normals, points.shape(0), "normals must be (k, 3), as the points");
        check_poses(T, normal_sign);
        cusp::check_finite(weights, "weights");
        threads = checked_threads(threads);
        const auto poses = static_cast<int64_t>(T.shape(0)), count = static_cast<int64_t>(points.shape(0));
        std::vector<double> refined(16 * poses);
        std::vector<uint8_t> converged(poses, 0);
        std::vector<int32_t> steps(poses, 0);
        // One pose uses all threads for its points, several poses one each: the same result.
        const int inner = poses == 1 ? threads : 1;
        const auto work = [&](int, int64_t pose) {
            Motion motion = Motion::of(T.data() + 16 * pose);
            std::vector<Correspondence> pairs(count);
            std::vector<int32_t> faces(count, -1);
            double allowed = start_factor * max_distance, lowest = std::numeric_limits<double>::infinity();
            int lowest_at = 0;
            for (int k = 1; k <= iterations && !converged[pose]; ++k) {
                steps[pose] = k;
                in_blocks(count, inner, [&](int64_t first, int64_t last) {
                    for (int64_t i = first; i < last; ++i) {
                        const Point moved = motion(row(points, i));
                        const SurfacePoint found = tree_.closest(moved.data(), faces[i]);
                        faces[i] = found.face;
                        if (found.face < 0) {  // the steps led to where squares are infinite
                            pairs[i] = {moved, moved, {}, 0};
                            continue;
                        }
                        const Vec n = tree_.normal(found.face);
                        double w = std::sqrt(found.distance_sq) <= allowed ? weights.data()[i] : 0;
                        if (normals && !(normal_sign.data()[pose] *
                                             cusp::dot(cusp::rotated(motion.R, row(*normals, i)), n) >
                                         min_agreement))
                            w = 0;
                        pairs[i] = {moved, found.point, n, w};
                    }
                });
                if (allowed == max_distance) {
                    const double cost = truncated_cost(pairs, weights, max_distance);
                    if (cost < lowest * (1 - stall_share)) {
                        lowest = cost;
                        lowest_at = k;
                    }
                    if (k - lowest_at >= stall_iterations) converged[pose] = 1;
                }
                if (std::count_if(pairs.begin(), pairs.end(), [](const auto& each) { return each.w > 0; }) <
                    min_pairs)
                    break;
                const Motion step = plane_step(pairs, damping, allowed);
                motion = step.after(motion);
                if (allowed == max_distance && rms_moved(pairs, step) < tolerance) converged[pose] = 1;
                allowed = std::max(max_distance, decay * allowed);
            }
            motion.write(refined.data() + 16 * pose);
        };
        {
            const nb::gil_scoped_release no_gil;
            if (poses == 1) {
                work(0, 0);
            } else {
                cusp::for_each(poses, threads, {}, work, 1);
            }
        }
        return {matrices(std::move(refined)), to_numpy(std::move(converged)), to_numpy(std::move(steps))};
    }

    // Point-to-point ICP of all points from the identity, none excluded (Besl & McKay 1992): T (1, 4, 4),
    // converged 0 or 1, iterations.
    std::tuple<OutMatrices, bool, int32_t> complete(const In2<double>& points, const In1<double>& weights,
                                                    int iterations, double tolerance) const {
        check_rows(points, weights.shape(0), "points must be (k, 3), one weight each");
        cusp::check_finite(weights, "weights");
        const auto count = static_cast<int64_t>(points.shape(0));
        Motion motion;
        bool converged = false;
        int32_t steps = 0;
        {
            const nb::gil_scoped_release no_gil;
            std::vector<Point> moved(count), target(count);
            std::vector<int32_t> near(count, -1);
            while (steps < iterations && !converged) {
                ++steps;
                for (int64_t i = 0; i < count; ++i) {
                    moved[i] = motion(row(points, i));
                    const SurfacePoint found = tree_.closest(moved[i].data(), near[i]);
                    near[i] = found.face;
                    target[i] = found.point;
                }
                const Motion step = fit(moved, target, weights);
                motion = step.after(motion);
                double sum = 0;
                for (const Point& each : moved) {
                    const Vec by = cusp::minus(step(each).data(), each.data());
                    sum += cusp::dot(by, by);
                }
                converged = std::sqrt(sum / static_cast<double>(count)) < tolerance;
            }
        }
        std::vector<double> found(16);
        motion.write(found.data());
        return {matrices(std::move(found)), converged, steps};
    }

   private:
    // The motion with the least weighted sum of squared distances to the targets
    static Motion fit(const std::vector<Point>& source, const std::vector<Point>& target,
                      const In1<double>& weights) {
        double total = 0;
        Point from{0, 0, 0}, to{0, 0, 0};
        for (size_t i = 0; i < source.size(); ++i) {
            const double w = weights.data()[i];
            total += w;
            for (int k = 0; k < 3; ++k) from[k] += w * source[i][k], to[k] += w * target[i][k];
        }
        for (int k = 0; k < 3; ++k) from[k] /= total, to[k] /= total;
        cusp::Matrix3 S{};
        for (size_t i = 0; i < source.size(); ++i)
            for (int k = 0; k < 3; ++k)
                for (int l = 0; l < 3; ++l)
                    S[k][l] += weights.data()[i] * (target[i][k] - to[k]) * (source[i][l] - from[l]);
        Motion motion{cusp::best_rotation(S), {0, 0, 0}};
        const Point turned = motion(from);
        for (int k = 0; k < 3; ++k) motion.t[k] = to[k] - turned[k];
        return motion;
    }

    static const double* checked(const In2<double>& vertices, const In2<int32_t>& faces) {
        check_rows(vertices, vertices.shape(0), "vertices must be (n, 3)");
        cusp::check_faces(faces, static_cast<int64_t>(vertices.shape(0)));
        return vertices.data();
    }

    // work(first, last) for blocks of [0, count)
    template <class Work>
    static void in_blocks(int64_t count, int threads, Work&& work) {
        constexpr int64_t kBlock = 512;  // affects only the time
        const int64_t blocks = (count + kBlock - 1) / kBlock;
        if (threads <= 1 || blocks <= 1) {
            work(0, count);
            return;
        }
        cusp::for_each(
            blocks, threads, {},
            [&](int, int64_t block) { work(block * kBlock, std::min(count, (block + 1) * kBlock)); }, 1);
    }

    void check_near(const In1<int64_t>& near, size_t count) const {
        if (near.shape(0) != count) throw std::invalid_argument("one near face a point");
        cusp::check_indices(near, tree_.size(), "near face");
    }

    static double truncated_cost(const std::vector<Correspondence>& pairs, const In1<double>& weights,
                                 double max_distance) {
        double sum = 0;
        for (size_t i = 0; i < pairs.size(); ++i) {
            const Vec by = cusp::minus(pairs[i].q.data(), pairs[i].p.data());
            sum += weights.data()[i] * std::min(cusp::dot(by, by), max_distance * max_distance);
        }
        return sum;
    }

    static double rms_moved(const std::vector<Correspondence>& pairs, const Motion& step) {
        double sum = 0;
        for (const auto& each : pairs) {
            const Vec by = cusp::minus(step(each.p).data(), each.p.data());
            sum += cusp::dot(by, by);
        }
        return std::sqrt(sum / static_cast<double>(pairs.size()));
    }

    SurfaceTree tree_;
};

}  // namespace

void bind_icp(nb::module_& m) {
    nb::class_<SampleTarget>(m, "SampleTarget")
        .def(nb::init<const In2<double>&, const In2<double>&>(), "points"_a, "normals"_a)
        .def("refine", &SampleTarget::refine, "points"_a, "normals"_a, "T"_a, "normal_sign"_a,
             "max_distance"_a, "min_agreement"_a, "damping"_a, "iterations"_a, "threads"_a);
    nb::class_<SurfaceTarget>(m, "SurfaceTarget")
        .def(nb::init<const In2<double>&, const In2<int32_t>&>(), "vertices"_a, "faces"_a)
        .def("closest", &SurfaceTarget::closest, "points"_a, "near"_a.none(), "threads"_a)
        .def("complete", &SurfaceTarget::complete, "points"_a, "weights"_a, "iterations"_a, "tolerance"_a)
        .def("refine", &SurfaceTarget::refine, "points"_a, "normals"_a.none(), "weights"_a, "T"_a,
             "normal_sign"_a, "max_distance"_a, "start_factor"_a, "decay"_a, "min_agreement"_a, "damping"_a,
             "min_pairs"_a, "iterations"_a, "tolerance"_a, "stall_share"_a, "stall_iterations"_a,
             "threads"_a);
}
