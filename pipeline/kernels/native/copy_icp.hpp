// Point-to-point ICP (Besl & McKay 1992) of a moved copy of some points to the points; see kernels/copy_icp.py.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <vector>

#include "point_tree.hpp"

namespace cusp {

using Matrix3 = std::array<Point, 3>;  // rows

// p_to = R p_from + t
struct Motion {
    Matrix3 R{{{1, 0, 0}, {0, 1, 0}, {0, 0, 1}}};
    Point t{0, 0, 0};

    Point operator()(const Point& p) const {
        Point to;
        for (int k = 0; k < 3; ++k) to[k] = R[k][0] * p[0] + R[k][1] * p[1] + R[k][2] * p[2] + t[k];
        return to;
    }
};

// The rotation with the largest trace of R S^T, S = sum of target source^T: the eigenvector of a symmetric 4 x 4 with the largest
// eigenvalue, as a quaternion (Horn 1987), by Jacobi's rotations. Always proper; the identity when S is zero.
inline Matrix3 best_rotation(const Matrix3& S) {
    const auto& [x, y, z] = S;  // rows: of the target
    double N[4][4] = {{x[0] + y[1] + z[2], z[1] - y[2], x[2] - z[0], y[0] - x[1]},
                      {z[1] - y[2], x[0] - y[1] - z[2], x[1] + y[0], x[2] + z[0]},
                      {x[2] - z[0], x[1] + y[0], y[1] - x[0] - z[2], y[2] + z[1]},
                      {y[0] - x[1], x[2] + z[0], y[2] + z[1], z[2] - x[0] - y[1]}};
    double V[4][4] = {{1, 0, 0, 0}, {0, 1, 0, 0}, {0, 0, 1, 0}, {0, 0, 0, 1}};
    constexpr int kSweeps = 30;  // it converges quadratically: five or six do
    for (int sweep = 0; sweep < kSweeps; ++sweep) {
        bool turned = false;
        for (int i = 0; i < 3; ++i) {
            for (int j = i + 1; j < 4; ++j) {
                if (std::abs(N[i][j]) <= 1e-18 * (std::abs(N[i][i]) + std::abs(N[j][j]))) continue;
                turned = true;
                const double theta = (N[j][j] - N[i][i]) / (2 * N[i][j]);
                const double tangent = (theta < 0 ? -1.0 : 1.0) / (std::abs(theta) + std::sqrt(theta * theta + 1));
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
        if (!turned) break;
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
    // Where two rules stop on one trajectory; iterations: motions estimated until there.
    struct Trajectory {
        Motion library, converged;
        int32_t library_iterations = 0, iterations = 0;
        bool is_converged = false;
    };
    struct Rules {
        int32_t library_iterations;  // most
        double library_tolerance;    // change of the RMS distance to the nearest points
        int32_t iterations;          // most until the correspondences stay
    };

    // What an alignment writes into, kept from one to the next.
    struct Scratch {
        std::vector<Point> copy, asked;
        std::vector<int32_t> nearest;
        std::vector<double> others;
    };

    CopyIcp(const double* points, int32_t n) : tree_(points, n) {}

    int32_t size() const { return tree_.size(); }

    // ICP of start(points) to the points, from where they are.
    Trajectory align(const Motion& start, const Rules& rules, Scratch& scratch) const {
        const int32_t n = size();
        scratch.copy.resize(n), scratch.asked.resize(n), scratch.nearest.resize(n), scratch.others.resize(n);
        Point centre{0, 0, 0};
        for (int32_t i = 0; i < n; ++i) {
            scratch.copy[i] = start(tree_.point(i));
            for (int k = 0; k < 3; ++k) centre[k] += scratch.copy[i][k] / n;
        }
        Trajectory found;
        Motion motion;
        bool in_library = true;
        double rms = associate(motion, scratch, true).rms;
        for (int32_t iteration = 1; iteration <= rules.iterations; ++iteration) {
            motion = fit(centre, scratch);
            const Association now = associate(motion, scratch, false);
            if (in_library) {
                found.library = motion, found.library_iterations = iteration;
                in_library = std::abs(rms - now.rms) >= rules.library_tolerance && iteration < rules.library_iterations;
            }
            rms = now.rms;
            found.converged = motion, found.iterations = iteration;
            if (now.changed == 0) {
                found.is_converged = true;  // every further motion is this one, by either rule
                break;
            }
        }
        return found;
    }

    // RMS distance of back(start(points)) to the points, each to its own.
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

    // Nearest point of every point of the moved copy. A point is not asked for again while it provably has the nearest that it
    // had: while the sum of its distances to that and to where it was last asked for stays below the distance that the second
    // nearest had there (triangle inequality). The margin is above the rounding error of distances.
    Association associate(const Motion& motion, Scratch& scratch, bool is_first) const {
        constexpr double kMargin = 1 + 1e-12;
        const int32_t n = size();
        int64_t changed = 0;
        double sum = 0;
        for (int32_t i = 0; i < n; ++i) {
            const Point x = motion(scratch.copy[i]);
            const int32_t before = is_first ? i : scratch.nearest[i];
            double d_sq = distance_sq(x, tree_.point(before));
            if (is_first || !((std::sqrt(d_sq) + std::sqrt(distance_sq(x, scratch.asked[i]))) * kMargin < scratch.others[i])) {
                const PointTree::Nearest found = tree_.nearest(x, before);
                changed += found.slot != before;
                scratch.nearest[i] = found.slot;
                scratch.others[i] = std::sqrt(found.second_sq);
                scratch.asked[i] = x;
                d_sq = found.first_sq;
            }
            sum += d_sq;
        }
        return {changed, std::sqrt(sum / n)};
    }

    // Least squares from the copy, not from where the last motion put it: rounding errors do not add up over iterations. Over
    // points they do, as in any library's plain sums: see kernels/copy_icp.py.
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
        const Point turned = motion(centre);
        for (int k = 0; k < 3; ++k) motion.t[k] = mean[k] / n - turned[k];
        return motion;
    }

    PointTree tree_;
};

}  // namespace cusp
