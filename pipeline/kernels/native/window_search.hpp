// Exact polyhedral geodesics from one vertex by window propagation, in order of distance.
//
// A window is an interval of an edge that straight lines from one (pseudo-)source reach through the same
// faces (Mitchell, Mount, Papadimitriou 1987). Windows and vertices share one priority queue. Windows are
// pruned by "one angle, one split" (Chen & Han 1990) and the filter of Xin & Wang (2009). A vertex that
// leaves the queue has its final distance, so a search can stop at a radius or at its target vertex, and its
// cost is limited to that ball.
#pragma once

#include <cstdint>
#include <limits>
#include <numbers>
#include <utility>
#include <vector>

#include "distance_queue.hpp"
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

    // Search from one source, or from several (then the distances are to the nearest of them).
    // settle(vertex, distance) returns the radius of the further search; called in ascending order of
    // distance.
    template <class Settle>
    void run(int32_t source, double radius, Settle&& settle) {
        run(&source, &source + 1, radius, std::forward<Settle>(settle));
    }

    template <class Iterator, class Settle>
    void run(Iterator first, Iterator last, double radius, Settle&& settle) {
        clear();
        radius_ = radius;
        for (; first != last; ++first) improve(static_cast<int32_t>(*first), 0.0, 0.0);
        while (!queue_.empty() && queue_.min_key() <= radius_) {
            const DistanceQueue::Entry entry = queue_.pop();
            if (entry.number < 0) {
                const int32_t v = ~entry.number;
                if (settled_[v]) continue;  // an outdated, longer path
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

    // Number of windows that the last run created: a measure of its cost.
    int64_t windows_made() const { return made_; }

   private:
    // Points (a, 0), a0 <= a <= a1, in the frame of half-edge h. The (pseudo-)source lies behind it at (x,
    // -y), y > 0, at the distance sigma from the source.
    struct Window {
        double a0, a1, x, y, sigma;
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

    // direction: angle in the fan of v from which the path arrives, radians.
    void improve(int32_t v, double distance, double direction) {
        if (!(distance < distance_[v]) || settled_[v] || distance > radius_) return;
        if (distance_[v] == kInfinity) touched_.push_back(v);
        distance_[v] = distance;
        came_from_[v] = direction;
        queue_.push(distance, ~v);
    }

    void add(const Window& window) {
        const double beside = window.x < window.a0   ? window.a0 - window.x
                              : window.x > window.a1 ? window.x - window.a1
                                                     : 0.0;
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
        queue_.push(key, number);
    }

    // Xin & Wang (2009): a window is useless if a path through an end of its edge is at least as short for
    // all its points.
    bool is_useful(const Window& w) const {
        const double to_a0 = w.sigma + norm(w.a0 - w.x, w.y), to_a1 = w.sigma + norm(w.a1 - w.x, w.y);
        const HalfEdge& edge = mesh_.edges[w.h];
        return distance_[edge.start] + w.a1 >= to_a1 * (1 - kTie) &&
               distance_[edge.end] + (edge.length - w.a0) >= to_a0 * (1 - kTie);
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
        const bool same = mesh_.edges[edge.across].start == from;
        const Window window =
            same ? Window{u0, u1, x, depth, sigma, edge.across}
                 : Window{edge.length - u1, edge.length - u0, edge.length - x, depth, sigma, edge.across};
        if (is_useful(window)) add(window);
    }

    void propagate(const Window& w) {
        const HalfEdge& edge = mesh_.edges[w.h];
        const double px = edge.ox, py = edge.oy, length = edge.length;
        const double to_vertex = norm(px - w.x, py + w.y);
        const double straight =
            w.x + (px - w.x) * (w.y / (py + w.y));  // where the line to the opposite vertex crosses the edge
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
    void child(const HalfEdge& edge, int32_t near_end, int32_t far_end, double b0, double b1, bool to_vertex,
               double x, double y, double px, double py, double base, double sigma) {
        const double length = edge.length;
        if (!(length > 0)) return;
        auto meets =
            [&](double b) {  // where the line from (x, -y) through (b, 0) meets the edge, from near_end
                const double below = y * px - (b - x) * py;
                return below > 0 ? std::clamp(b * y / below, 0.0, 1.0) * length : length;
            };
        const double u0 = meets(b0), u1 = to_vertex ? length : meets(b1);
        const double ex = px / length, ey = py / length;
        const double along = x * ex - y * ey, depth = y * ex + x * ey;
        // The third vertex of the face (Xin & Wang 2009): its line to the near end of the interval crosses
        // all lines of the window.
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
    DistanceQueue queue_;  // of windows by index, and of vertices v by ~v
    std::vector<Window> windows_;
    std::vector<int32_t> free_;
    double radius_ = kInfinity;
    int64_t made_ = 0;
};

}  // namespace cusp
