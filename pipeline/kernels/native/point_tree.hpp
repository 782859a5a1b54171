// k-d tree (Friedman, Bentley & Finkel 1977): the nearest point, and the distance of the second-nearest.
//
// The search starts from a guess. Among equally near points the one with the smallest index is found,
// whatever the rounding of box distances. nanoflann was measured as an alternative: queries near the nearest
// point take 1.2 to 1.5 times as long, and its rounded box distances could miss an equally near point.
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <limits>
#include <numeric>
#include <vector>

#include "motion.hpp"

namespace cusp {

inline double distance_sq(const Point& a, const Point& b) {
    const double x = a[0] - b[0], y = a[1] - b[1], z = a[2] - b[2];
    return x * x + y * y + z * z;
}

// Stores the points in the order of the leaves. `slot` is a position in this order; `number` is the index of
// the caller.
class PointTree {
   public:
    // The nearest point (among equally near ones that with the smallest number) and its squared distance;
    // squared distance of the second-nearest point, inf if there is only one point.
    struct Nearest {
        int32_t slot;
        double first_sq, second_sq;
    };

    PointTree(const double* points, int32_t n) : number_(n), points_(n) {
        std::iota(number_.begin(), number_.end(), 0);
        for (int64_t i = 0; i < n; ++i) points_[i] = {points[3 * i], points[3 * i + 1], points[3 * i + 2]};
        const std::vector<Point> original = points_;
        build(original, 0, n);
        for (int32_t slot = 0; slot < n; ++slot) points_[slot] = original[number_[slot]];
    }

    int32_t size() const { return static_cast<int32_t>(points_.size()); }
    const Point& point(int32_t slot) const { return points_[slot]; }

    // guess : slot of any point; the search is faster the nearer it is to x
    Nearest nearest(const Point& x, int32_t guess) const {
        Nearest result{guess, distance_sq(x, points_[guess]), std::numeric_limits<double>::infinity()};
        Point outside{0, 0, 0};
        search(0, x, outside, result);
        return result;
    }

    // Slot of the nearest point whose squared distance is below `limit_sq`, -1 if there is none; among
    // equally near ones that with the smallest number. guess : a slot that is likely near, or -1
    int32_t nearest_within(const Point& x, int32_t guess, double limit_sq) const {
        First result{-1, limit_sq};
        if (guess >= 0) consider_first(guess, x, result);
        Point outside{0, 0, 0};
        if (!points_.empty()) search_first(0, x, outside, result);
        return result.slot;
    }

    int32_t number(int32_t slot) const { return number_[slot]; }

   private:
    static constexpr int32_t kLeaf = 8;  // points of a leaf, at most; affects only the time

    // The children of an inner node contain the points with coordinates <= low and >= high along `axis`. A
    // leaf has axis -1.
    struct Node {
        int32_t axis, first, last;  // of a leaf: its slots; of an inner node: its children
        double low, high;
    };

    int32_t build(const std::vector<Point>& original, int32_t first, int32_t last) {
        const auto self = static_cast<int32_t>(nodes_.size());
        nodes_.push_back({-1, first, last, 0.0, 0.0});
        if (last - first <= kLeaf) return self;
        const int32_t axis = longest_axis(original, first, last), middle = first + (last - first) / 2;
        const auto begin = number_.begin();
        std::nth_element(begin + first, begin + middle, begin + last, [&](int32_t a, int32_t b) {
            return original[a][axis] < original[b][axis] || (original[a][axis] == original[b][axis] && a < b);
        });
        const double high = original[number_[middle]][axis];
        double low = -std::numeric_limits<double>::infinity();
        for (int32_t k = first; k < middle; ++k) low = std::max(low, original[number_[k]][axis]);
        const int32_t below = build(original, first, middle), above = build(original, middle, last);
        nodes_[self] = {axis, below, above, low, high};
        return self;
    }

    int32_t longest_axis(const std::vector<Point>& original, int32_t first, int32_t last) const {
        Point low_corner = original[number_[first]], high_corner = low_corner;
        for (int32_t k = first + 1; k < last; ++k) {
            for (int axis = 0; axis < 3; ++axis) {
                low_corner[axis] = std::min(low_corner[axis], original[number_[k]][axis]);
                high_corner[axis] = std::max(high_corner[axis], original[number_[k]][axis]);
            }
        }
        int32_t longest = 0;
        for (int32_t axis = 1; axis < 3; ++axis)
            if (high_corner[axis] - low_corner[axis] > high_corner[longest] - low_corner[longest])
                longest = axis;
        return longest;
    }

    // outside : distance of x to the box of the node along each axis. The squared distance to the box is
    // summed in the same order as that to a point, so rounding cannot make it larger than the squared
    // distance to a point in the box.
    void search(int32_t node, const Point& x, Point& outside, Nearest& result) const {
        const Node& at = nodes_[node];
        if (at.axis < 0) {
            for (int32_t slot = at.first; slot < at.last; ++slot)
                consider(slot, distance_sq(x, points_[slot]), result);
            return;
        }
        const double above_low = x[at.axis] - at.low, below_high = at.high - x[at.axis];
        const bool is_below = above_low < below_high;
        search(is_below ? at.first : at.last, x, outside, result);
        const double before = outside[at.axis];
        outside[at.axis] = std::max(before, is_below ? below_high : above_low);
        if (outside[0] * outside[0] + outside[1] * outside[1] + outside[2] * outside[2] <= result.second_sq)
            search(is_below ? at.last : at.first, x, outside, result);
        outside[at.axis] = before;
    }

    struct First {
        int32_t slot;
        double distance_sq;
    };

    void search_first(int32_t node, const Point& x, Point& outside, First& result) const {
        const Node& at = nodes_[node];
        if (at.axis < 0) {
            for (int32_t slot = at.first; slot < at.last; ++slot) consider_first(slot, x, result);
            return;
        }
        const double above_low = x[at.axis] - at.low, below_high = at.high - x[at.axis];
        const bool is_below = above_low < below_high;
        search_first(is_below ? at.first : at.last, x, outside, result);
        const double before = outside[at.axis];
        outside[at.axis] = std::max(before, is_below ? below_high : above_low);
        if (outside[0] * outside[0] + outside[1] * outside[1] + outside[2] * outside[2] <= result.distance_sq)
            search_first(is_below ? at.last : at.first, x, outside, result);
        outside[at.axis] = before;
    }

    void consider_first(int32_t slot, const Point& x, First& result) const {
        const double d_sq = distance_sq(x, points_[slot]);
        if (d_sq < result.distance_sq ||
            (d_sq == result.distance_sq && result.slot >= 0 && number_[slot] < number_[result.slot]))
            result = {slot, d_sq};
    }

    void consider(int32_t slot, double d_sq, Nearest& result) const {
        if (d_sq > result.second_sq || slot == result.slot) return;
        if (d_sq < result.first_sq || (d_sq == result.first_sq && number_[slot] < number_[result.slot]))
            result = {slot, d_sq, result.first_sq};
        else
            result.second_sq = d_sq;
    }

    std::vector<int32_t> number_;
    std::vector<Point> points_;
    std::vector<Node> nodes_;
};

}  // namespace cusp
