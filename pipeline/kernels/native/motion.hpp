// Rigid motions.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>

namespace cusp {

using Point = std::array<double, 3>;
using Matrix3 = std::array<Point, 3>;  // rows

inline Point rotated(const Matrix3& R, const Point& p) {
    Point to;
    for (int k = 0; k < 3; ++k) to[k] = R[k][0] * p[0] + R[k][1] * p[1] + R[k][2] * p[2];
    return to;
}

// Rigid motion p_to = R p_from + t.
struct Motion {
    Matrix3 R{{{1, 0, 0}, {0, 1, 0}, {0, 0, 1}}};
    Point t{0, 0, 0};

    Point operator()(const Point& p) const {
        Point to;
        for (int k = 0; k < 3; ++k) to[k] = R[k][0] * p[0] + R[k][1] * p[1] + R[k][2] * p[2] + t[k];
        return to;
    }

    // This motion after `first`
    Motion after(const Motion& first) const {
        Motion both;
        for (int i = 0; i < 3; ++i)
            for (int j = 0; j < 3; ++j)
                both.R[i][j] = R[i][0] * first.R[0][j] + R[i][1] * first.R[1][j] + R[i][2] * first.R[2][j];
        both.t = (*this)(first.t);
        return both;
    }

    // From and to a 4 x 4 homogeneous matrix, row-major
    static Motion of(const double* matrix) {
        Motion motion;
        for (size_t k = 0; k < 3; ++k) {
            motion.R[k] = {matrix[4 * k], matrix[4 * k + 1], matrix[4 * k + 2]};
            motion.t[k] = matrix[4 * k + 3];
        }
        return motion;
    }

    void write(double* matrix) const {
        for (size_t k = 0; k < 3; ++k) {
            std::copy(R[k].begin(), R[k].end(), matrix + 4 * k);
            matrix[4 * k + 3] = t[k];
            matrix[12 + k] = 0;
        }
        matrix[15] = 1;
    }
};

// The rotation by a rotation vector, radians (Rodrigues)
inline Matrix3 rotation_of(const Point& vector) {
    const double angle = std::sqrt(vector[0] * vector[0] + vector[1] * vector[1] + vector[2] * vector[2]);
    const double inverse = 1 / std::max(angle, 1e-300);
    const double x = vector[0] * inverse, y = vector[1] * inverse, z = vector[2] * inverse;
    const double s = std::sin(angle), c = 1 - std::cos(angle);
    return {{{1 - c * (y * y + z * z), c * x * y - s * z, c * x * z + s * y},
             {c * x * y + s * z, 1 - c * (x * x + z * z), c * y * z - s * x},
             {c * x * z - s * y, c * y * z + s * x, 1 - c * (x * x + y * y)}}};
}

}  // namespace cusp
