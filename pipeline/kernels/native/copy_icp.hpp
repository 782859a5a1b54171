// Point-to-point ICP (Besl & McKay 1992) of a moved copy of a point set to the point set; see
// kernels/copy_icp.py.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <vector>

#include "motion.hpp"
#include "point_tree.hpp"

namespace cusp {

// The rotation R that maximises trace(R S^T), S = sum of target source^T (Horn 1987): its quaternion is the
// eigenvector of the largest eigenvalue of the symmetric 4 x 4 matrix N, found by Jacobi rotations. Always a
// proper rotation; the identity if S is zero.
inline Matrix3 best_rotation(const Matrix3& S) {
    const auto& [x, y, z] = S;  // rows: coordinates of the target
    double N[4][4] = {{x[0] + y[1] + z[2], z[1] - y[2], x[2] - z[0], y[0] - x[1]},
                      {z[1] - y[2], x[0] - y[1] - z[2], x[1] + y[0], x[2] + z[0]},
                      {x[2] - z[0], x[1] + y[0], y[1] - x[0] - z[2], y[2] + z[1]},
                      {y[0] - x[1], x[2] + z[0], y[2] + z[1], z[2] - x[0] - y[1]}};
    double V[4][4] = {{1, 0, 0, 0}, {0, 1, 0, 0}, {0, 0, 1, 0}, {0, 0, 0, 1}};
    constexpr int kSweeps = 30;  // at most; the convergence is quadratic, five or six are usual
    constexpr double kNegligible =
        1e-18;  // relative size of an off-diagonal element that counts as 0; below rounding
    for (int sweep = 0; sweep < kSweeps; ++sweep) {
        bool rotated = false;
        for (int i = 0; i < 3; ++i) {
            for (int j = i + 1; j < 4; ++j) {
                if (std::abs(N[i][j]) <= kNegligible * (std::abs(N[i][i]) + std::abs(N[j][j]))) continue;
                rotated = true;
                const double theta = (N[j][j] - N[i][i]) / (2 * N[i][j]);
                const double tangent =
                    (theta < 0 ? -1.0 : 1.0) / (std::abs(theta) + std::sqrt(theta * theta + 1));
                const double c = 1 / std::sqrt(tangent * tangent + 1), s = tangent * c;
                for (auto& row : N) {
                    const double a = row[i], b = row[j];
                    row[i] = c * a - s * b, row[j] = s * a + c * b;
                }
                for (int k = 0; k < 4; ++k) {
                    const double a = N[i][k], b = N[j][k];
                    N[i][k] = c * a - s * b, N[j][k] = s * a + c * b;
                }
                for (auto& row : V) {
                    const double a = row[i], b = row[j];
                    row[i] = c * a - s * b, row[j] = s * a + c * b;
                }
                N[i][j] = N[j][i] = 0;
            }
        }
        if (!rotated) break;
    }
    int best = 0;
    for (int k = 1; k < 4; ++k)
        if (N[k][k] > N[best][best]) best = k;
    double w = V[0][best], a = V[1][best], b = V[2][best], c = V[3][best];
    const double length = std::sqrt(w * w + a * a + b * b + c * c);
    w /= length, a /= length, b /= length, c /= length;
    return {{{1 - 2 * (b * b + c * c), 2 * (a * b - w * c), 2 * (a * c + w * b)},
             {2 * (a * b + w * c), 1 - 2 * (a * a + c * c), 2 * (b * c - w * a)},
             {2 * (a * c - w * b), 2 * (b * c + w * a), 1 - 2 * (a * a + b * b)}}};
}

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
