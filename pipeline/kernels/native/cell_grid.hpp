// Cubic cells of the size of a search radius: the neighbours of a point lie in its cell and the 26 around it.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <numeric>
#include <vector>

namespace cusp {

class CellGrid {
   public:
    // points : (n, 3), must outlive the grid; radius > 0
    CellGrid(const double* points, int64_t n, double radius)
        : points_(points), radius_sq_(radius * radius), cell_of_(n), order_(n) {
        std::array<double, 3> high{};
        for (int axis = 0; axis < 3; ++axis) {
            low_[axis] = high[axis] = n ? points[axis] : 0;
            for (int64_t i = 1; i < n; ++i) {
                low_[axis] = std::min(low_[axis], points[3 * i + axis]);
                high[axis] = std::max(high[axis], points[3 * i + axis]);
            }
        }
        // A sparse cloud gets larger cells: more of them than points would cost memory for nothing.
        double size = radius;
        for (;; size *= 2) {
            double cells = 1;
            for (int axis = 0; axis < 3; ++axis) cells *= std::floor((high[axis] - low_[axis]) / size) + 1;
            if (cells <= 8.0 * static_cast<double>(n) + 64) break;
        }
        size_ = size;
        for (int axis = 0; axis < 3; ++axis)
            count_[axis] = static_cast<int64_t>(std::floor((high[axis] - low_[axis]) / size)) + 1;
        for (int64_t i = 0; i < n; ++i) {
            const auto at = cell(i);
            cell_of_[i] = (at[0] * count_[1] + at[1]) * count_[2] + at[2];
        }
        first_.assign(count_[0] * count_[1] * count_[2] + 1, 0);
        for (const int64_t c : cell_of_) ++first_[c + 1];
        std::partial_sum(first_.begin(), first_.end(), first_.begin());
        std::vector<int64_t> next(first_.begin(), first_.end() - 1);
        for (int64_t i = 0; i < n; ++i) order_[next[cell_of_[i]]++] = i;  // ascending in each cell
    }

    // visit(j, squared distance) of every other point nearer than the radius, always in the same order
    template <class Visit>
    void for_each_near(int64_t i, Visit&& visit) const {
        const double* p = points_ + 3 * i;
        const auto at = cell(i);
        for (int64_t x = std::max<int64_t>(at[0] - 1, 0); x <= std::min(at[0] + 1, count_[0] - 1); ++x)
            for (int64_t y = std::max<int64_t>(at[1] - 1, 0); y <= std::min(at[1] + 1, count_[1] - 1); ++y) {
                const int64_t row = (x * count_[1] + y) * count_[2];
                const int64_t begin = first_[row + std::max<int64_t>(at[2] - 1, 0)];
                const int64_t end = first_[row + std::min(at[2] + 1, count_[2] - 1) + 1];
                for (int64_t k = begin; k < end; ++k) {
                    const int64_t j = order_[k];
                    const double dx = points_[3 * j] - p[0], dy = points_[3 * j + 1] - p[1],
                                 dz = points_[3 * j + 2] - p[2];
                    const double squared = dx * dx + dy * dy + dz * dz;
                    if (squared < radius_sq_ && j != i) visit(j, squared);
                }
            }
    }

   private:
    std::array<int64_t, 3> cell(int64_t i) const {
        std::array<int64_t, 3> at;
        for (int axis = 0; axis < 3; ++axis)
            at[axis] = std::min(static_cast<int64_t>((points_[3 * i + axis] - low_[axis]) / size_),
                                count_[axis] - 1);
        return at;
    }

    const double* points_;
    double radius_sq_, size_ = 0;
    std::array<double, 3> low_{};
    std::array<int64_t, 3> count_{};
    std::vector<int64_t> cell_of_, order_, first_;
};

}  // namespace cusp
