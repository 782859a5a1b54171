// Exact polyhedral geodesics from one vertex by window propagation, in order of distance.
//
// A window is an interval of an edge that straight lines from one (pseudo-)source reach through the same faces (Mitchell,
// Mount, Papadimitriou 1987). Windows are kept in one queue with the vertices and pruned as in Chen & Han (1990), "one angle,
// one split", with the filter of Xin & Wang (2009). Because of the order, every vertex that leaves the queue is settled, so
// a search may stop at a radius or at the first vertex it was looking for, and has then cost its ball only.
#pragma once

#include <cstdint>
#include <limits>
#include <numbers>
#include <utility>
#include <vector>

#include "geodesic_mesh.hpp"

namespace cusp {

inline constexpr double kInfinity = std::numeric_limits<double>::infinity();

class WindowSearch {
   public:
    explicit WindowSearch(const GeodesicMesh& mesh)
        : mesh_(mesh),
          most_windows_(kMostWindows * (static_cast<int64_t>(mesh.corner.size()) + 1)),
          distance_(mesh.n, kInfinity),
          came_from_(mesh.n, 0.0),
          settled_(mesh.n, 0),
          split_at_(mesh.corner.size(), 0.0),
          split_by_(mesh.corner.size(), kInfinity) {}

    // From one source, or from several at once (then distances are to the nearest of them).
    // settle(vertex, distance) -> largest distance still of interest; called in order of distance, the sources first.
    template <class Settle>
    void run(int32_t source, double radius, Settle&& settle) {
        run(&source, &source + 1, radius, std::forward<Settle>(settle));
    }

    template <class Iterator, class Settle>
    void run(Iterator first, Iterator last, double radius, Settle&& settle) {
        clear();
        radius_ = radius;
        for (; first != last; ++first) improve(static_cast<int32_t>(*first), 0.0, 0.0);
        while (!queue_.empty() && queue_.front().key <= radius_) {
            const Entry entry = dequeue();
            if (entry.number < 0) {
                const int32_t v = ~entry.number;
                if (settled_[v]) continue;  // an older, longer way to it
                settled_[v] = 1;
                radius_ = settle(v, distance_[v]);
                leave(v, distance_[v] == 0.0);
            } else {
                const Window window = windows_[entry.number];
                free_.push_back(entry.number);
                if (is_useful(window)) propagate(window);
            }
        }
    }

    // Windows made by the last run: what a search costs.
    int64_t windows_made() const { return made_; }

   private:
    // Points (a, 0), a0 <= a <= a1, in the frame of half-edge h; the (pseudo-)source lies behind it at (x, -y), y > 0, and is
    // sigma away from the source.
    struct Window {
        double a0, a1, x, y, sigma;
        int32_t h;
    };
    struct Entry {
        double key;
        int32_t number;  // of a window; of a vertex v: ~v
    };

    // Real meshes make some tens of windows an edge. Only where triangles have neither area nor length can they go round and
    // round; there, and only there, distances fall back to paths along edges.
    static constexpr int64_t kMostWindows = 2000;
    static constexpr double kRay = 1e-10;   // a vertex this near to the end of a window (in radians) is seen from it
    static constexpr double kTie = 1e-12;   // a window is dropped only when it is longer by more than this, relatively
    static constexpr double kBend = 1e-9;   // radians by which bends are widened against rounding
    static constexpr double kThin = 1e-13;  // of its edge: a thinner window is nothing but rounding

    void clear() {
        for (int32_t v : touched_) distance_[v] = kInfinity, settled_[v] = 0;
        for (int32_t h : touched_split_) split_by_[h] = kInfinity;
        touched_.clear();
        touched_split_.clear();
        queue_.clear();
        windows_.clear();
        free_.clear();
        made_ = 0;
    }

    // A heap of four children a node: half the levels of a binary one, and children share a cache line.
    void enqueue(double key, int32_t number) {
        size_t hole = queue_.size();
        queue_.push_back({key, number});
        while (hole > 0) {
            const size_t parent = (hole - 1) / 4;
            if (!(key < queue_[parent].key)) break;
            queue_[hole] = queue_[parent];
            hole = parent;
        }
        queue_[hole] = {key, number};
    }

    Entry dequeue() {
        const Entry top = queue_.front(), last = queue_.back();
        queue_.pop_back();
        const size_t size = queue_.size();
        for (size_t hole = 0; size > 0;) {
            const size_t first = 4 * hole + 1;
            size_t least = first;
            for (size_t child = first + 1; child < std::min(first + 4, size); ++child)
                if (queue_[child].key < queue_[least].key) least = child;
            if (first >= size || !(queue_[least].key < last.key)) {
                queue_[hole] = last;
                break;
            }
            queue_[hole] = queue_[least];
            hole = least;
        }
        return top;
    }

    // direction: where the path comes from, as an angle in the fan around v.
    void improve(int32_t v, double distance, double direction) {
        if (!(distance < distance_[v]) || settled_[v] || distance > radius_) return;
        if (distance_[v] == kInfinity) touched_.push_back(v);
        distance_[v] = distance;
        came_from_[v] = direction;
        enqueue(distance, ~v);
    }

    void add(const Window& window) {
        const double beside = window.x < window.a0 ? window.a0 - window.x : window.x > window.a1 ? window.x - window.a1 : 0.0;
        const double key = window.sigma + norm(beside, window.y);
        if (key > radius_) return;
        ++made_;
        int32_t number;
        if (free_.empty()) {
            number = static_cast<int32_t>(windows_.size());
            windows_.push_back(window);
        } else {
            number = free_.back();
            free_.pop_back();
            windows_[number] = window;
        }
        enqueue(key, number);
    }

    // Xin & Wang: a window whose every point is reached at least as well over an end of its edge gives no shortest path.
    bool is_useful(const Window& w) const {
        const double to_a0 = w.sigma + norm(w.a0 - w.x, w.y), to_a1 = w.sigma + norm(w.a1 - w.x, w.y);
        const HalfEdge& edge = mesh_.edges[w.h];
        return distance_[edge.start] + w.a1 >= to_a1 * (1 - kTie) &&
               distance_[edge.end] + (edge.length - w.a0) >= to_a0 * (1 - kTie);
    }

    // Ways on from a settled vertex: along its edges always (an upper bound for its neighbours, and exact where
    // the path is the edge), and through its faces where a path may bend.
    void leave(int32_t v, bool is_source) {
        const double sigma = distance_[v];
        for (int32_t i = mesh_.star_begin[v]; i < mesh_.star_begin[v + 1]; ++i) {
            const int32_t h = mesh_.star[i];
            const HalfEdge& edge = mesh_.edges[h];
            // The half-edge opposite `start` is the edge from `end` to v; the one opposite `end` is from v to `start`.
            improve(edge.start, sigma + mesh_.edges[edge.at_end].length, mesh_.towards_end[edge.at_start]);
            improve(edge.end, sigma + mesh_.edges[edge.at_start].length, mesh_.towards_start[edge.at_end]);
            if (is_source || mesh_.fan[v] == Fan::other) {
                cross(edge, edge.start, 0.0, edge.length, edge.ox, edge.oy, sigma);
            } else if (mesh_.bends[v]) {
                bend(v, h, sigma);
            }
        }
    }

    // A shortest path that bends at v leaves at least half a turn on both sides: only that part of the face gets windows.
    void bend(int32_t v, int32_t h, double sigma) {
        constexpr double pi = std::numbers::pi;
        const double from = came_from_[v], total = mesh_.total_angle[v];
        if (mesh_.fan[v] == Fan::closed) {
            beam(h, from + pi - kBend, from + total - pi + kBend, sigma);
            beam(h, from + pi - kBend - total, from - pi + kBend, sigma);
        } else {
            beam(h, -kBend, from - pi + kBend, sigma);
            beam(h, from + pi - kBend, total + kBend, sigma);
        }
    }

    // Windows on edge h of what is seen from its opposite vertex between two directions of the fan there.
    void beam(int32_t h, double low, double high, double sigma) {
        const double first = std::min(mesh_.towards_start[h], mesh_.towards_end[h]);
        const double last = std::max(mesh_.towards_start[h], mesh_.towards_end[h]);
        low = std::max(low, first);
        high = std::min(high, last);
        if (!(low < high)) return;
        const HalfEdge& edge = mesh_.edges[h];
        const double px = edge.ox, py = edge.oy, length = edge.length;
        auto meets = [&](double angle) {  // angle from the direction to start
            if (angle <= kBend) return 0.0;
            if (angle >= last - first - kBend) return length;
            const double c = std::cos(angle), s = std::sin(angle), down = px * s + py * c;
            return down > 0 ? std::clamp(px + (py * s - px * c) * (py / down), 0.0, length) : length;
        };
        const bool forwards = mesh_.towards_start[h] == first;
        const double u0 = meets(forwards ? low - first : last - high), u1 = meets(forwards ? high - first : last - low);
        cross(edge, edge.start, u0, u1, px, py, sigma);
    }

    // Put an interval of an edge, as seen from inside its face, onto the face across. u0, u1 and x are measured from `from`,
    // one end of it; depth is how far behind the edge the (pseudo-)source lies.
    void cross(const HalfEdge& edge, int32_t from, double u0, double u1, double x, double depth, double sigma) {
        if (!(depth > 0) || !(u1 - u0 > kThin * edge.length)) return;  // edge-on: its points are reached over the vertices
        if (edge.across < 0 || made_ > most_windows_) return;
        const bool same = mesh_.edges[edge.across].start == from;
        const Window window = same ? Window{u0, u1, x, depth, sigma, edge.across}
                                   : Window{edge.length - u1, edge.length - u0, edge.length - x, depth, sigma, edge.across};
        if (is_useful(window)) add(window);
    }

    void propagate(const Window& w) {
        const HalfEdge& edge = mesh_.edges[w.h];
        const double px = edge.ox, py = edge.oy, length = edge.length;
        const double to_vertex = norm(px - w.x, py + w.y);
        const double straight = w.x + (px - w.x) * (w.y / (py + w.y));  // where the line to the vertex enters
        const double near = kRay * to_vertex * (w.y / (py + w.y));
        const int32_t vertex = edge.opposite;
        bool left = straight > w.a0 + near, right = straight < w.a1 - near;
        if (straight >= w.a0 - near && straight <= w.a1 + near && w.sigma + to_vertex < distance_[vertex])
            improve(vertex, w.sigma + to_vertex, direction_of(w));
        double left_end = w.a1, right_start = w.a0;
        if (left && right) {
            const double distance = w.sigma + to_vertex;
            if (distance < split_by_[w.h]) {
                if (split_by_[w.h] == kInfinity) touched_split_.push_back(w.h);
                split_by_[w.h] = distance;
                split_at_[w.h] = straight;
            } else {  // one angle, one split: the other window's line to the vertex shields one side from this one
                (straight < split_at_[w.h] ? right : left) = false;
            }
            left_end = right_start = straight;
        }
        const bool split = left_end != w.a1;
        if (left) {
            child(mesh_.edges[edge.at_end], edge.start, edge.end, w.a0, left_end, split, w.x, w.y, px, py, length, w.sigma);
        }
        if (right) {  // the same in the mirror
            child(mesh_.edges[edge.at_start], edge.end, edge.start, length - w.a1, length - right_start, split, length - w.x, w.y,
                  length - px, py, length, w.sigma);
        }
    }

    // Where a window's source is seen from the opposite vertex of its face, as an angle in that vertex' fan.
    double direction_of(const Window& w) const {
        const HalfEdge& edge = mesh_.edges[w.h];
        if (!mesh_.bends[edge.opposite]) return 0.0;
        const double px = edge.ox, py = edge.oy;
        const double angle = std::atan2(px * w.y + py * w.x, px * (px - w.x) + py * (py + w.y));
        const double start = mesh_.towards_start[w.h];
        return start < mesh_.towards_end[w.h] ? start + angle : start - angle;
    }

    // The part [b0, b1] of a window goes on through `edge`, from `near_end` (the origin) to the opposite vertex (px, py).
    void child(const HalfEdge& edge, int32_t near_end, int32_t far_end, double b0, double b1, bool to_vertex, double x, double y, double px,
               double py, double base, double sigma) {
        const double length = edge.length;
        if (!(length > 0)) return;
        auto meets = [&](double b) {  // where the line from (x, -y) through (b, 0) meets the edge, from near_end
            const double below = y * px - (b - x) * py;
            return below > 0 ? std::clamp(b * y / below, 0.0, 1.0) * length : length;
        };
        const double u0 = meets(b0), u1 = to_vertex ? length : meets(b1);
        const double ex = px / length, ey = py / length;
        const double along = x * ex - y * ey, depth = y * ex + x * ey;
        // The third vertex of the face: its line to the near end of the interval crosses all the window's lines.
        const double third = distance_[far_end];
        if (third < kInfinity) {
            const double by_third = third + norm(u0 * ex - base, u0 * ey);
            if (by_third < (sigma + norm(u0 - along, depth)) * (1 - kTie)) return;
        }
        cross(edge, near_end, u0, u1, along, depth, sigma);
    }

    const GeodesicMesh& mesh_;
    const int64_t most_windows_;
    std::vector<double> distance_, came_from_;
    std::vector<uint8_t> settled_;
    std::vector<double> split_at_, split_by_;
    std::vector<int32_t> touched_, touched_split_;
    std::vector<Entry> queue_;
    std::vector<Window> windows_;
    std::vector<int32_t> free_;
    double radius_ = kInfinity;
    int64_t made_ = 0;
};

}  // namespace cusp
