// The two nearest of some points in space: a k-d tree (Friedman, Bentley & Finkel 1977) searched from a guess.
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <limits>
#include <numeric>
#include <vector>

namespace cusp {

using Point = std::array<double, 3>;

inline double distance_sq(const Point& a, const Point& b) {
    const double x = a[0] - b[0], y = a[1] - b[1], z = a[2] - b[2];
    return x * x + y * y + z * z;
}

// Holds the points in the order of its leaves: `slot` is a place in that order, `number` what the caller calls the point.
class PointTree {
   public:
    // The nearest point (of equally near ones that of the smallest number) and how near the second is: inf with one point.
    struct Nearest {
        int32_t slot;
        double first_sq, second_sq;
    };

    PointTree(const double* points, int32_t n) : number_(n), points_(n) {
        std::iota(number_.begin(), number_.end(), 0);
        for (int32_t i = 0; i < n; ++i) points_[i] = {points[3 * i], points[3 * i + 1], points[3 * i + 2]};
        const std::vector<Point> given = points_;
        build(given, 0, n);
        for (int32_t slot = 0; slot < n; ++slot) points_[slot] = given[number_[slot]];
    }

    int32_t size() const { return static_cast<int32_t>(points_.size()); }
    const Point& point(int32_t slot) const { return points_[slot]; }

    // `guess` : the slot of any point; the nearer it is to x, the less is searched
    Nearest nearest(const Point& x, int32_t guess) const {
        Nearest found{guess, distance_sq(x, points_[guess]), std::numeric_limits<double>::infinity()};
        Point away{0, 0, 0};
        search(0, x, away, found);
        return found;
    }

   private:
    static constexpr int32_t kLeaf = 8;

    // An inner node's children hold what is up to `low` and what is from `high` on along `axis`; a leaf's axis is -1.
    struct Node {
        int32_t axis, first, last;  // first, last: of a leaf its slots, else the children's numbers
        double low, high;
    };

    int32_t build(const std::vector<Point>& given, int32_t first, int32_t last) {
        const auto me = static_cast<int32_t>(nodes_.size());
        nodes_.push_back({-1, first, last, 0.0, 0.0});
        if (last - first <= kLeaf) return me;
        const int32_t axis = longest_axis(given, first, last), middle = first + (last - first) / 2;
        const auto begin = number_.begin();
        std::nth_element(begin + first, begin + middle, begin + last, [&](int32_t a, int32_t b) {
            return given[a][axis] < given[b][axis] || (given[a][axis] == given[b][axis] && a < b);
        });
        const double high = given[number_[middle]][axis];
        double low = -std::numeric_limits<double>::infinity();
        for (int32_t k = first; k < middle; ++k) low = std::max(low, given[number_[k]][axis]);
        const int32_t below = build(given, first, middle), above = build(given, middle, last);
        nodes_[me] = {axis, below, above, low, high};
        return me;
    }

    int32_t longest_axis(const std::vector<Point>& given, int32_t first, int32_t last) const {
        Point least = given[number_[first]], most = least;
        for (int32_t k = first + 1; k < last; ++k) {
            for (int axis = 0; axis < 3; ++axis) {
                least[axis] = std::min(least[axis], given[number_[k]][axis]);
                most[axis] = std::max(most[axis], given[number_[k]][axis]);
            }
        }
        int32_t longest = 0;
        for (int32_t axis = 1; axis < 3; ++axis)
            if (most[axis] - least[axis] > most[longest] - least[longest]) longest = axis;
        return longest;
    }

    // away : how far x is outside the box of the node along each axis; a distance to the box is added up in the order in which
    // one to a point is, so rounding cannot make it the larger of the two
    void search(int32_t node, const Point& x, Point& away, Nearest& found) const {
        const Node& at = nodes_[node];
        if (at.axis < 0) {
            for (int32_t slot = at.first; slot < at.last; ++slot) consider(slot, distance_sq(x, points_[slot]), found);
            return;
        }
        const double above_low = x[at.axis] - at.low, below_high = at.high - x[at.axis];
        const bool is_below = above_low < below_high;
        search(is_below ? at.first : at.last, x, away, found);
        const double before = away[at.axis];
        away[at.axis] = std::max(before, is_below ? below_high : above_low);
        if (away[0] * away[0] + away[1] * away[1] + away[2] * away[2] <= found.second_sq)
            search(is_below ? at.last : at.first, x, away, found);
        away[at.axis] = before;
    }

    void consider(int32_t slot, double d_sq, Nearest& found) const {
        if (d_sq > found.second_sq || slot == found.slot) return;
        if (d_sq < found.first_sq || (d_sq == found.first_sq && number_[slot] < number_[found.slot]))
            found = {slot, d_sq, found.first_sq};
        else
            found.second_sq = d_sq;
    }

    std::vector<int32_t> number_;
    std::vector<Point> points_;
    std::vector<Node> nodes_;
};

}  // namespace cusp
