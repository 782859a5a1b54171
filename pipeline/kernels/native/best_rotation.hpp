// The rotation that brings corresponding points closest together.
#pragma once

#include <cmath>

#include "motion.hpp"

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

}  // namespace cusp
