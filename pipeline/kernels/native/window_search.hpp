// Exact polyhedral geodesics from one vertex by window propagation, in order of distance.
//
// A window is an interval of an edge that straight lines from one (pseudo-)source reach through the same
// faces (Mitchell, Mount, Papadimitriou 1987). Windows are pruned by "one angle, one split" (Chen & Han 1990)
// and the filter of Xin & Wang (2009).
//
// Windows are propagated in buckets of distance, without order within a bucket; vertices are settled in order
// of distance, each when no window nearer than it is left. It has its final distance then, so a search can
// stop at a radius or at its target vertex, and its cost is limited to that ball. The order of the windows is
// of no consequence: each stands for paths that exist, and pruning needs none of it.
#pragma once

#include <algorithm>
#include <cstdint>
#include <functional>
#include <limits>
#include <numbers>
#include <utility>
#include <vector>

#include "bucket_queue.hpp"
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
          split_by_(mesh.corner.size(), kInfinity),
          windows_(bucket_width(mesh)) {}

    // Search from one source, or from several (then the distances are to the nearest of them).
    // settle(vertex, distance) returns the radius of the further search, negative to end it; called in
    // ascending order of distance.
    template <class Settle>
    void run(int32_t source, double radius, Settle&& settle) {
        run(&source, &source + 1, radius, std::forward<Settle>(settle));
    }

    template <class Iterator, class Settle>
    void run(Iterator first, Iterator last, double radius, Settle&& settle) {
        clear();
        radius_ = radius;
        for (; first != last; ++first) improve(static_cast<int32_t>(*first), 0.0, 0.0);
        do {
            do {
                propagate_open();
            } while (settle_next(settle));
        } while (radius_ >= 0 && open_next());
    }

    // Number of windows that the last run created: a measure of its cost.
    int64_t windows_made() const { return made_; }

   private:
    // Points (a, 0), a0 <= a <= a1, in the frame of half-edge h. The (pseudo-)source lies behind it at (x,
    // -y), y > 0, at the distance sigma from the source; d0 and d1 are the distances of the ends from the
    // source. The record fills one cache line.
    struct alignas(64) Window {
        double a0, a1, x, y, sigma, d0, d1;
        int32_t h;
    };
    // Windows per half-edge, at most. Real meshes need some tens; only triangles without area and length can
    // create windows without end, and only there the distances fall back to paths along edges. All limits are
    // chosen by hand, not fitted.
    static constexpr int64_t kMostWindows = 2000;
    // Radians: a vertex this close to the end of a window is visible from it.
    static constexpr double kRay = 1e-10;
    // Relative: a window is dropped only if it is longer by more than this.
    static constexpr double kTie = 1e-12;
    // Radians by which the directions at a bend are widened against rounding.
    static constexpr double kBend = 1e-9;
    // Share of the edge length: a thinner window is a rounding error.
    static constexpr double kThin = 1e-13;
    // Buckets of windows per mean edge length. Chosen by hand; affects only the time.
    static constexpr double kBucketsPerEdge = 2;

    static double bucket_width(const GeodesicMesh& mesh) {
        double sum = 0.0;
        for (const HalfEdge& edge : mesh.edges) sum += edge.length;
        return sum > 0 ? sum / (kBucketsPerEdge * static_cast<double>(mesh.edges.size())) : 1.0;
    }

    void clear() {
        for (int32_t v : touched_) distance_[v] = kInfinity, settled_[v] = 0;
        for (int32_t h : touched_split_) split_by_[h] = kInfinity;
        touched_.clear();
        touched_split_.clear();
        vertices_.clear();
        windows_.clear();
        made_ = 0;
    }

    struct Arrival {
        double distance;
        int32_t vertex;
        bool operator>(const Arrival& other) const {
            return distance != other.distance ? distance > other.distance : vertex > other.vertex;
        }
    };

    // Settle the nearest vertex if no window that waits can be nearer; false if there is none.
    template <class Settle>
    bool settle_next(Settle&& settle) {
        while (!vertices_.empty()) {
            const Arrival next = vertices_.front();
            if (next.distance > radius_ || !windows_.is_open(next.distance)) return false;
            std::pop_heap(vertices_.begin(), vertices_.end(), std::greater<>{});
            vertices_.pop_back();
            if (settled_[next.vertex]) continue;  // an outdated, longer path
            settled_[next.vertex] = 1;
            radius_ = settle(next.vertex, next.distance);
            leave(next.vertex, next.distance == 0.0);
            return true;
        }
        return false;
    }

    // Propagate the windows of the open bucket, and those that arise in it.
    void propagate_open() {
        Window window;
        while (radius_ >= 0 && windows_.pop(window))
            if (is_useful(window, mesh_.edges[window.h])) propagate(window);
    }

    // Go on to the next distance at which a window or a vertex waits; false if there is none in the radius.
    bool open_next() {
        const double nearest = vertices_.empty() ? kInfinity : vertices_.front().distance;
        return windows_.open_next(radius_, nearest);
    }

    // direction: angle in the fan of v from which the path arrives, radians.
    void improve(int32_t v, double distance, double direction) {
        if (!(distance < distance_[v]) || settled_[v] || distance > radius_) return;
        if (distance_[v] == kInfinity) touched_.push_back(v);
        distance_[v] = distance;
        came_from_[v] = direction;
        vertices_.push_back({distance, v});
        std::push_heap(vertices_.begin(), vertices_.end(), std::greater<>{});
    }

    void add(const Window& window) {
        const double key = window.x < window.a0   ? window.d0
                           : window.x > window.a1 ? window.d1
                                                  : window.sigma + window.y;
        if (key > radius_) return;
        ++made_;
        windows_.push(key, window);
    }

    // Xin & Wang (2009): a window is useless if a path through an end of its edge is at least as short for
    // all its points.
    bool is_useful(const Window& w, const HalfEdge& edge) const {
        return distance_[edge.start] + w.a1 >= w.d1 * (1 - kTie) &&
               distance_[edge.end] + (edge.length - w.a0) >= w.d0 * (1 - kTie);
    }

    // Continue from a settled vertex: along its edges (an upper bound for its neighbours, and exact if the
    // path is the edge), and through its faces if a path may bend there.
    void leave(int32_t v, bool is_source) {
        const double sigma = distance_[v];
        for (int32_t i = mesh_.star_begin[v]; i < mesh_.star_begin[v + 1]; ++i) {
            const int32_t h = mesh_.star[i];
            const HalfEdge& edge = mesh_.edges[h];
            // The half-edge opposite `start` is the edge from `end` to v; the one opposite `end` is from v to
            // `start`.
            improve(edge.start, sigma + mesh_.edges[edge.at_end].length, mesh_.towards_end[edge.at_start]);
            improve(edge.end, sigma + mesh_.edges[edge.at_start].length, mesh_.towards_start[edge.at_end]);
            if (is_source || mesh_.fan[v] == Fan::other) {
                cross(edge, edge.start, 0.0, edge.length, edge.ox, edge.oy, sigma);
            } else if (mesh_.bends[v]) {
                bend(v, h, sigma);
            }
        }
    }

    // A shortest path that bends at v leaves an angle of at least pi on both sides: only that part of the
    // face gets windows.
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

    // Window on edge h of the part that is visible from the opposite vertex between two directions of its
    // fan.
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
        const double u0 = meets(forwards ? low - first : last - high),
                     u1 = meets(forwards ? high - first : last - low);
        cross(edge, edge.start, u0, u1, px, py, sigma);
    }

    // Transfer an interval of an edge from its face to the adjacent face. u0, u1 and x are measured from the
    // vertex `from` of the edge; depth is the distance of the (pseudo-)source behind the edge.
    void cross(const HalfEdge& edge, int32_t from, double u0, double u1, double x, double depth,
               double sigma) {
        if (!(depth > 0) || !(u1 - u0 > kThin * edge.length))
            return;  // degenerate: its points are reached through the vertices
        if (edge.across < 0 || made_ > most_windows_) return;
        const double d0 = sigma + norm(u0 - x, depth), d1 = sigma + norm(u1 - x, depth);
        transfer(edge, from, u0, u1, x, depth, sigma, d0, d1);
    }

    // d0, d1 : distances of the ends from the source
    [[gnu::noinline]] void transfer(const HalfEdge& edge, int32_t from, double u0, double u1, double x,
                                    double depth, double sigma, double d0, double d1) {
        const HalfEdge& over = mesh_.edges[edge.across];
        const double length = edge.length;
        const Window window = over.start == from ? Window{u0, u1, x, depth, sigma, d0, d1, edge.across}
                                                 : Window{length - u1, length - u0, length - x, depth,
                                                          sigma,       d1,          d0,         edge.across};
        if (is_useful(window, over)) add(window);
    }

    // Inlined with `child` into the loop over the windows: a fifth of the time.
    [[gnu::always_inline]] void propagate(const Window& w) {
        const HalfEdge& edge = mesh_.edges[w.h];
        const double px = edge.ox, py = edge.oy, length = edge.length;
        const double to_vertex = norm(px - w.x, py + w.y), share = w.y / (py + w.y);
        // Where the line to the opposite vertex crosses the edge.
        const double straight = w.x + (px - w.x) * share;
        const double near = kRay * to_vertex * share;
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
            } else {  // one angle, one split: the other window reaches one side by a shorter path
                (straight < split_at_[w.h] ? right : left) = false;
            }
            left_end = right_start = straight;
        }
        const bool split = left_end != w.a1;
        if (left) {
            child(mesh_.edges[edge.at_end], edge.start, edge.end, w.a0, left_end, split, w.x, w.y, px, py,
                  length, w.sigma);
        }
        if (right) {  // mirrored
            child(mesh_.edges[edge.at_start], edge.end, edge.start, length - w.a1, length - right_start,
                  split, length - w.x, w.y, length - px, py, length, w.sigma);
        }
    }

    // Direction of the source of a window at the opposite vertex of its face, as an angle in the fan of that
    // vertex.
    double direction_of(const Window& w) const {
        const HalfEdge& edge = mesh_.edges[w.h];
        if (!mesh_.bends[edge.opposite]) return 0.0;
        const double px = edge.ox, py = edge.oy;
        const double angle = std::atan2(px * w.y + py * w.x, px * (px - w.x) + py * (py + w.y));
        const double start = mesh_.towards_start[w.h];
        return start < mesh_.towards_end[w.h] ? start + angle : start - angle;
    }

    // Propagate the part [b0, b1] of a window through `edge`, from `near_end` (the origin) to the opposite
    // vertex (px, py).
    [[gnu::always_inline]] void child(const HalfEdge& edge, int32_t near_end, int32_t far_end, double b0,
                                      double b1, bool to_vertex, double x, double y, double px, double py,
                                      double base, double sigma) {
        const double length = edge.length;
        if (edge.across < 0 || made_ > most_windows_ || !(length > 0)) return;
        auto meets =
            [&](double b) {  // where the line from (x, -y) through (b, 0) meets the edge, from near_end
                const double below = y * px - (b - x) * py;
                return below > 0 ? std::clamp(b * y / below, 0.0, 1.0) * length : length;
            };
        const double u0 = meets(b0), u1 = to_vertex ? length : meets(b1);
        const double ex = px * edge.per_length, ey = py * edge.per_length;
        const double along = x * ex - y * ey, depth = y * ex + x * ey;
        if (!(depth > 0) || !(u1 - u0 > kThin * length)) return;
        const double d0 = sigma + norm(u0 - along, depth);
        // The third vertex of the face (Xin & Wang 2009): its line to the near end of the interval crosses
        // all lines of the window.
        const double third = distance_[far_end];
        if (third < d0 && third + norm(u0 * ex - base, u0 * ey) < d0 * (1 - kTie)) return;
        transfer(edge, near_end, u0, u1, along, depth, sigma, d0, sigma + norm(u1 - along, depth));
    }

    const GeodesicMesh& mesh_;
    const int64_t most_windows_;
    std::vector<double> distance_, came_from_;
    std::vector<uint8_t> settled_;
    std::vector<double> split_at_, split_by_;
    std::vector<int32_t> touched_, touched_split_;
    BucketQueue<Window> windows_;    // by the distance of their nearest point
    std::vector<Arrival> vertices_;  // a heap, nearest first
    double radius_ = kInfinity;
    int64_t made_ = 0;
};

}  // namespace cusp
