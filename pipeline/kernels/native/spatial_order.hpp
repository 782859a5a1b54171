// An order of points in which neighbours stand near each other: along a Z-shaped curve (Morton 1966).
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <utility>
#include <vector>

namespace cusp {

// The numbers 0 ... count - 1 of the points (count, 3), finite; equal places keep their order.
inline std::vector<int32_t> spatial_order(const double* points, int64_t count) {
    constexpr unsigned kBits = 10;  // cells along each axis: 2^10
    std::array<double, 3> low{}, per_cell{};
    for (int axis = 0; axis < 3; ++axis) {
        double from = points[axis], to = points[axis];
        for (int64_t i = 1; i < count; ++i) {
            from = std::min(from, points[3 * i + axis]);
            to = std::max(to, points[3 * i + axis]);
        }
        low[axis] = from;
        per_cell[axis] = to > from ? ((1U << kBits) - 1) / (to - from) : 0.0;
    }
    std::vector<std::pair<uint32_t, int32_t>> cells(count);
    for (int64_t i = 0; i < count; ++i) {
        uint32_t code = 0;
        for (unsigned axis = 0; axis < 3; ++axis) {
            const auto cell = static_cast<uint32_t>((points[3 * i + axis] - low[axis]) * per_cell[axis]);
            for (unsigned bit = 0; bit < kBits; ++bit) code |= ((cell >> bit) & 1U) << (3 * bit + axis);
        }
        cells[i] = {code, static_cast<int32_t>(i)};
    }
    std::sort(cells.begin(), cells.end());
    std::vector<int32_t> order(count);
    for (int64_t i = 0; i < count; ++i) order[i] = cells[i].second;
    return order;
}

}  // namespace cusp
