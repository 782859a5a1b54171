// Point-to-point ICP (Besl & McKay 1992) of a moved copy of a point set to the point set; see
// kernels/copy_icp.py.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <vector>

#include "best_rotation.hpp"
#include "motion.hpp"
#include "point_tree.hpp"

namespace cusp {

class CopyIcp {
   public:
    // The motions at which the two rules stop on one trajectory; iterations: number of motions estimated
    // until then.
    struct Trajectory {
        Motion library, converged;
        int32_t library_iterations = 0, iterations = 0;
        bool is_converged = false;
    };
    struct Rules {
        int32_t library_iterations;  // at most
        double library_tolerance;    // change of the RMS distance to the nearest points
        int32_t iterations;          // at most, until the correspondences do not change
    };

    // Working memory of an alignment, reused for the next one.
    struct Scratch {
        std::vector<Point> copy, searched_at;
        std::vector<int32_t> nearest;
        std::vector<double> second_distance;
    };

    CopyIcp(const double* points, int32_t n) : tree_(points, n) {}

    int32_t size() const { return tree_.size(); }

    // ICP of the copy start(points) to the points.
    Trajectory align(const Motion& start, const Rules& rules, Scratch& scratch) const {
        const int32_t n = size();
        scratch.copy.resize(n), scratch.searched_at.resize(n), scratch.nearest.resize(n),
            scratch.second_distance.resize(n);
        Point centre{0, 0, 0};
        for (int32_t i = 0; i < n; ++i) {
            scratch.copy[i] = start(tree_.point(i));
            for (int k = 0; k < 3; ++k) centre[k] += scratch.copy[i][k] / n;
        }
        Trajectory trajectory;
        Motion motion;
        bool in_library = true;
        double rms = associate(motion, scratch, true).rms;
        for (int32_t iteration = 1; iteration <= rules.iterations; ++iteration) {
            motion = fit(centre, scratch);
            const Association now = associate(motion, scratch, false);
            if (in_library) {
                trajectory.library = motion, trajectory.library_iterations = iteration;
                in_library = std::abs(rms - now.rms) >= rules.library_tolerance &&
                             iteration < rules.library_iterations;
            }
            rms = now.rms;
            trajectory.converged = motion, trajectory.iterations = iteration;
            if (now.changed == 0) {
                trajectory.is_converged = true;  // by either rule, every further motion would be the same
                break;
            }
        }
        return trajectory;
    }

    // RMS distance of back(start(points)) to the points, with true correspondences.
    double rms_error(const Motion& start, const Motion& back) const {
        double sum = 0;
        for (int32_t i = 0; i < size(); ++i) sum += distance_sq(back(start(tree_.point(i))), tree_.point(i));
        return std::sqrt(sum / size());
    }

   private:
    struct Association {
        int64_t changed;
        double rms;
    };

    // Nearest neighbour of every point of the moved copy. The search of a point is skipped if its nearest
    // neighbour is provably unchanged, by the triangle inequality: if its distance to that neighbour plus its
    // distance to the place of the last search is less than the distance of the second-nearest point at that
    // search. kMargin exceeds the rounding error of the distances.
    Association associate(const Motion& motion, Scratch& scratch, bool is_first) const {
        constexpr double kMargin = 1 + 1e-12;
        const int32_t n = size();
        int64_t changed = 0;
        double sum = 0;
        for (int32_t i = 0; i < n; ++i) {
            const Point x = motion(scratch.copy[i]);
            const int32_t before = is_first ? i : scratch.nearest[i];
            double d_sq = distance_sq(x, tree_.point(before));
            if (is_first ||
                !((std::sqrt(d_sq) + std::sqrt(distance_sq(x, scratch.searched_at[i]))) * kMargin <
                  scratch.second_distance[i])) {
                const PointTree::Nearest result = tree_.nearest(x, before);
                changed += result.slot != before;
                scratch.nearest[i] = result.slot;
                scratch.second_distance[i] = std::sqrt(result.second_sq);
                scratch.searched_at[i] = x;
                d_sq = result.first_sq;
            }
            sum += d_sq;
        }
        return {changed, std::sqrt(sum / n)};
    }

    // Least-squares motion (Horn 1987) of the original copy, not of the copy after the last motion, so
    // rounding errors do not accumulate over the iterations. They do over the points, as in the plain sums of
    // common libraries.
    Motion fit(const Point& centre, const Scratch& scratch) const {
        const int32_t n = size();
        Matrix3 S{};
        Point mean{0, 0, 0};
        for (int32_t i = 0; i < n; ++i) {
            const Point& target = tree_.point(scratch.nearest[i]);
            for (int k = 0; k < 3; ++k) {
                mean[k] += target[k];
                for (int l = 0; l < 3; ++l) S[k][l] += target[k] * (scratch.copy[i][l] - centre[l]);
            }
        }
        Motion motion{best_rotation(S), {0, 0, 0}};
        const Point rotated = motion(centre);
        for (int k = 0; k < 3; ++k) motion.t[k] = mean[k] / n - rotated[k];
        return motion;
    }

    PointTree tree_;
};

}  // namespace cusp
