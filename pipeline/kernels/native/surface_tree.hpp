// Bounding-box tree of triangles: the closest point of a surface, in double precision.
//
// Among triangles that are equally near to the last bit the one with the smallest number is found, so the
// result depends neither on the tree nor on where a search starts.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <limits>
#include <numeric>
#include <stdexcept>
#include <vector>

#include "triangle.hpp"

namespace cusp {

struct SurfacePoint {
    int32_t face = -1;
    Vec weights{};  // barycentric
    Vec point{};
    double distance_sq = std::numeric_limits<double>::infinity();
};

class SurfaceTree {
   public:
    // vertices (n, 3), faces (m, 3) with indices in [0, n), m >= 1
    SurfaceTree(const double* vertices, const int32_t* faces, int32_t m)
        : corners_(9 * static_cast<size_t>(m)) {
        if (m < 1) throw std::invalid_argument("a surface needs a triangle");
        std::vector<Box> box(m);
        std::vector<Vec> middle(m);
        for (int32_t f = 0; f < m; ++f) {
            for (size_t k = 0; k < 3; ++k) {
                const double* v = vertices + 3 * static_cast<size_t>(faces[3 * static_cast<size_t>(f) + k]);
                std::copy(v, v + 3, corners_.data() + 9 * static_cast<size_t>(f) + 3 * k);
                box[f].add(v);
            }
            for (int axis = 0; axis < 3; ++axis) middle[f][axis] = (box[f].low[axis] + box[f].high[axis]) / 2;
        }
        order_.resize(m);
        std::iota(order_.begin(), order_.end(), 0);
        nodes_.reserve(2 * static_cast<size_t>(m));
        build(box, middle, 0, m);
        slot_.resize(m);
        std::vector<double> ordered(corners_.size());
        for (int32_t slot = 0; slot < m; ++slot) {
            slot_[order_[slot]] = slot;
            std::copy_n(corners_.data() + 9 * static_cast<size_t>(order_[slot]), 9,
                        ordered.data() + 9 * static_cast<size_t>(slot));
        }
        corners_ = std::move(ordered);
    }

    // guess : a face that is likely near, or -1; affects only the time
    SurfacePoint closest(const double* p, int32_t guess) const {
        SurfacePoint best;
        if (guess >= 0) consider(slot_[guess], p, best);
        search(p, best);
        return best;
    }

    // Normal of a triangle; zero where it has no area
    Vec normal(int32_t face) const {
        const double* c = corners_.data() + 9 * static_cast<size_t>(slot_[face]);
        Vec n = cross(minus(c + 3, c), minus(c + 6, c));
        const double length = std::sqrt(dot(n, n));
        for (double& each : n) each = length > 0 ? each / length : 0;
        return n;
    }

    int32_t size() const { return static_cast<int32_t>(order_.size()); }

   private:
    static constexpr int32_t kLeaf = 2;     // triangles of a leaf, at most; affects only the time
    static constexpr int kMostLevels = 64;  // the tree halves its triangles, of which there are below 2^31
    // Relative: a box is left out only if it is farther by more than this, since distances are rounded.
    static constexpr double kSlack = 1e-12;

    struct Box {
        Vec low{kFar, kFar, kFar}, high{-kFar, -kFar, -kFar};
        static constexpr double kFar = std::numeric_limits<double>::infinity();

        void add(const double* p) {
            for (int k = 0; k < 3; ++k) low[k] = std::min(low[k], p[k]), high[k] = std::max(high[k], p[k]);
        }

        double distance_sq(const double* p) const {
            double sum = 0;
            for (int k = 0; k < 3; ++k) {
                const double outside = std::max({low[k] - p[k], p[k] - high[k], 0.0});
                sum += outside * outside;
            }
            return sum;
        }
    };

    // A leaf has count > 0 triangles from slot `first`; an inner node the children first, first + 1.
    struct Node {
        Box box;
        int32_t first, count;
    };

    void build(const std::vector<Box>& box, const std::vector<Vec>& middle, int32_t begin, int32_t end) {
        struct Open {
            int32_t node, begin, end;
        };
        nodes_.push_back({});
        std::vector<Open> open{{0, begin, end}};
        while (!open.empty()) {
            const Open at = open.back();
            open.pop_back();
            Box whole, centres;
            for (int32_t k = at.begin; k < at.end; ++k) {
                whole.add(box[order_[k]].low.data());
                whole.add(box[order_[k]].high.data());
                centres.add(middle[order_[k]].data());
            }
            nodes_[at.node] = {whole, at.begin, at.end - at.begin};
            if (at.end - at.begin <= kLeaf) continue;
            int axis = 0;
            for (int k = 1; k < 3; ++k)
                if (centres.high[k] - centres.low[k] > centres.high[axis] - centres.low[axis]) axis = k;
            const int32_t half = at.begin + (at.end - at.begin) / 2;
            const auto first = order_.begin();
            std::nth_element(first + at.begin, first + half, first + at.end, [&](int32_t a, int32_t b) {
                return middle[a][axis] < middle[b][axis] || (middle[a][axis] == middle[b][axis] && a < b);
            });
            const auto child = static_cast<int32_t>(nodes_.size());
            nodes_.push_back({});
            nodes_.push_back({});
            nodes_[at.node].first = child;
            nodes_[at.node].count = 0;
            open.push_back({child, at.begin, half});
            open.push_back({child + 1, half, at.end});
        }
    }

    void search(const double* p, SurfacePoint& best) const {
        struct Waiting {
            int32_t node;
            double distance_sq;
        };
        std::array<Waiting, kMostLevels> stack;
        int waiting = 0;
        stack[waiting++] = {0, nodes_[0].box.distance_sq(p)};
        while (waiting > 0) {
            const Waiting next = stack[--waiting];
            if (next.distance_sq * (1 - kSlack) > best.distance_sq) continue;
            const Node& node = nodes_[next.node];
            if (node.count > 0) {
                for (int32_t k = node.first; k < node.first + node.count; ++k) consider(k, p, best);
                continue;
            }
            const double left = nodes_[node.first].box.distance_sq(p),
                         right = nodes_[node.first + 1].box.distance_sq(p);
            const bool left_first = left <= right;
            stack[waiting++] = left_first ? Waiting{node.first + 1, right} : Waiting{node.first, left};
            stack[waiting++] = left_first ? Waiting{node.first, left} : Waiting{node.first + 1, right};
        }
    }

    void consider(int32_t slot, const double* p, SurfacePoint& best) const {
        const double* c = corners_.data() + 9 * static_cast<size_t>(slot);
        const int32_t face = order_[slot];
        const Vec w = weights_of_closest(p, c, c + 3, c + 6);
        Vec point;
        double squared = 0;
        for (int k = 0; k < 3; ++k) {
            point[k] = w[0] * c[k] + w[1] * c[3 + k] + w[2] * c[6 + k];
            squared += (p[k] - point[k]) * (p[k] - point[k]);
        }
        if (squared < best.distance_sq || (squared == best.distance_sq && face < best.face))
            best = {face, w, point, squared};
    }

    // Triangles are stored in the order of the leaves: `slot` is a position in it.
    std::vector<double> corners_;        // (m, 3 corners, 3) by slot
    std::vector<int32_t> order_, slot_;  // the face of a slot, the slot of a face
    std::vector<Node> nodes_;
};

}  // namespace cusp
