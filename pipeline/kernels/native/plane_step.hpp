// One Gauss-Newton step of point-to-plane ICP; see kernels/icp.py.
#pragma once

#include <array>
#include <cmath>
#include <vector>

#include "motion.hpp"
#include "triangle.hpp"

namespace cusp {

// A point p, its target point q with the unit normal n, and the weight w >= 0.
struct Correspondence {
    Vec p, q, n;
    double w;
};

// Solve the symmetric positive definite system A x = b by A = L D L^T.
inline std::array<double, 6> solve(std::array<std::array<double, 6>, 6> A, std::array<double, 6> b) {
    for (int j = 0; j < 6; ++j) {
        for (int k = 0; k < j; ++k) A[j][j] -= A[j][k] * A[j][k] * A[k][k];
        for (int i = j + 1; i < 6; ++i) {
            for (int k = 0; k < j; ++k) A[i][j] -= A[i][k] * A[j][k] * A[k][k];
            A[i][j] /= A[j][j];
        }
    }
    for (int i = 0; i < 6; ++i)
        for (int k = 0; k < i; ++k) b[i] -= A[i][k] * b[k];
    for (int i = 0; i < 6; ++i) b[i] /= A[i][i];
    for (int i = 5; i >= 0; --i)
        for (int k = i + 1; k < 6; ++k) b[i] -= A[k][i] * b[k];
    return b;
}

// The motion that reduces sum w (n . (p - q))^2. Along unconstrained degrees of freedom it is zero, by
// `damping` times the trace of the normal equations. Along one that is held by little but noise, a step could
// lead far off the target: while it moves the points by more than `reach`, the damping grows (Levenberg). The
// directions that the pairs do hold keep their share of the step. Sums run in the order of the pairs.
inline Motion plane_step(const std::vector<Correspondence>& pairs, double damping, double reach) {
    constexpr double kTiny = 1e-300, kGrowth = 10, kLeastGrown = 1e-12, kMaxDamping = 1;
    double total = 0;
    Vec centre{};
    for (const auto& each : pairs) {
        total += each.w;
        for (int k = 0; k < 3; ++k) centre[k] += each.w * each.p[k];
    }
    for (double& each : centre) each /= std::max(total, kTiny);
    double spread = 0;
    std::array<std::array<double, 3>, 3> moments{};  // sum w arm arm^T
    for (const auto& each : pairs) {
        const Vec arm = minus(each.p.data(), centre.data());
        spread += each.w * dot(arm, arm);
        for (int i = 0; i < 3; ++i)
            for (int j = 0; j < 3; ++j) moments[i][j] += each.w * arm[i] * arm[j];
    }
    // Rotations in units of the RMS radius: a well-scaled system.
    const double scale = std::max(std::sqrt(spread / std::max(total, kTiny)), kTiny);
    std::array<std::array<double, 6>, 6> A{};
    std::array<double, 6> b{};
    for (const auto& each : pairs) {
        const Vec turn = cross(minus(each.p.data(), centre.data()), each.n);
        const double J[6] = {turn[0] / scale, turn[1] / scale, turn[2] / scale,
                             each.n[0],       each.n[1],       each.n[2]};
        const double residual = each.w * dot(each.n, minus(each.q.data(), each.p.data()));
        for (int i = 0; i < 6; ++i) {
            b[i] += J[i] * residual;
            const double weighted = each.w * J[i];
            for (int j = 0; j <= i; ++j) A[i][j] += weighted * J[j];
        }
    }
    double trace = 0;
    for (int i = 0; i < 6; ++i) trace += A[i][i];
    const auto damped = [&] {
        auto D = A;
        for (int i = 0; i < 6; ++i) D[i][i] += damping * trace + kTiny;
        return solve(D, b);
    };
    auto x = damped();
    // RMS motion of the points by x, to first order: that of w x arm is |w|^2 |arm|^2 - (w . arm)^2.
    const auto length = [&] {
        double turned = 0, shifted = 0;
        for (int i = 0; i < 3; ++i) {
            turned += spread * x[i] * x[i];
            shifted += x[3 + i] * x[3 + i];
            for (int j = 0; j < 3; ++j) turned -= x[i] * moments[i][j] * x[j];
        }
        return std::sqrt(std::max(0.0, turned) / (scale * scale * std::max(total, kTiny)) + shifted);
    };
    for (double grown = std::max(damping, kLeastGrown); length() > reach && grown < kMaxDamping;) {
        grown *= kGrowth;
        damping = grown;
        x = damped();
    }
    for (int i = 0; i < 3; ++i) x[i] /= scale;
    Motion motion;
    motion.R = rotation_of({x[0], x[1], x[2]});
    for (int k = 0; k < 3; ++k)
        motion.t[k] = x[3 + k] + centre[k] -
                      (motion.R[k][0] * centre[0] + motion.R[k][1] * centre[1] + motion.R[k][2] * centre[2]);
    return motion;
}

}  // namespace cusp
