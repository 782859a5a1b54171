// A triangle mesh that can be changed locally: edges are split, collapsed and flipped.
//
// Half-edge h = 3 f + k goes from corner k of triangle f to corner k + 1. Its twin is the same edge seen from
// the other triangle, -1 at an open border. Creases and borders are lines that no change removes.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <stdexcept>
#include <utility>
#include <vector>

#include "triangle.hpp"

namespace cusp {

// What a vertex lies on, and so where it may go: anywhere on the surface, along a line, nowhere
enum class Place : uint8_t { kSurface, kLine, kCorner };

class HalfEdges {
   public:
    // vertices (n, 3), faces (m, 3) with indices in [0, n). An edge that is not between two triangles of the
    // same orientation is a border. Triangles that meet in a vertex without an edge get a copy of it each.
    HalfEdges(const double* vertices, int32_t n, const int32_t* faces, int32_t m)
        : points(n), first(n, -1), corner(faces, faces + 3 * static_cast<size_t>(m)) {
        for (int32_t v = 0; v < n; ++v)
            std::copy_n(vertices + 3 * static_cast<size_t>(v), 3, points[v].data());
        twin = twins(n);
        crease.assign(corner.size(), 0);
        separate_fans();
        place.resize(points.size(), Place::kSurface);
        for (const int32_t v : split_) place[v] = Place::kCorner;
    }

    std::vector<Vec> points;
    std::vector<int32_t> first;   // of a vertex: a half-edge that starts there, the border's at a border
    std::vector<int32_t> corner;  // of a half-edge: the vertex where it starts, -1 of a removed triangle
    std::vector<int32_t> twin;
    std::vector<uint8_t> crease;
    std::vector<Place> place;

    static int32_t next(int32_t h) { return h % 3 == 2 ? h - 2 : h + 1; }
    static int32_t prev(int32_t h) { return h % 3 == 0 ? h + 2 : h - 1; }

    int32_t size() const { return static_cast<int32_t>(corner.size()); }
    int32_t start(int32_t h) const { return corner[h]; }
    int32_t end(int32_t h) const { return corner[next(h)]; }
    bool is_alive(int32_t h) const { return corner[h] >= 0; }
    bool is_border(int32_t h) const { return twin[h] < 0; }
    bool is_line(int32_t h) const { return is_border(h) || crease[h] != 0; }
    // One of the two half-edges of each edge
    bool is_edge(int32_t h) const { return is_alive(h) && h > twin[h]; }
    bool is_on_border(int32_t v) const { return is_border(first[v]); }

    double length_sq(int32_t h) const {
        const Vec along = minus(points[end(h)].data(), points[start(h)].data());
        return dot(along, along);
    }

    // Twice the area times the unit normal of triangle h / 3
    Vec normal(int32_t h) const {
        const int32_t f = h - h % 3;
        const double* a = points[corner[f]].data();
        return cross(minus(points[corner[f + 1]].data(), a), minus(points[corner[f + 2]].data(), a));
    }

    // Call visit(h) for each half-edge that starts at v, in turn around it
    template <class Visit>
    void around(int32_t v, Visit&& visit) const {
        const int32_t begin = first[v];
        int32_t h = begin;
        do {
            visit(h);
            h = twin[prev(h)];
        } while (h >= 0 && h != begin);
    }

    // Call visit(u) for each neighbour u of v
    template <class Visit>
    void neighbours(int32_t v, Visit&& visit) const {
        int32_t last = -1;
        around(v, [&](int32_t h) {
            visit(end(h));
            last = prev(h);
        });
        if (is_border(last)) visit(start(last));
    }

    int32_t valence(int32_t v) const {
        int32_t count = 0;
        neighbours(v, [&](int32_t) { ++count; });
        return count;
    }

    bool are_neighbours(int32_t u, int32_t v) const {
        bool found = false;
        neighbours(u, [&](int32_t w) { found |= w == v; });
        return found;
    }

    // A new vertex in the middle of the edge
    void split(int32_t h) {
        const int32_t a = start(h), b = end(h), t = twin[h], m = static_cast<int32_t>(points.size());
        const Vec &from = points[a], &to = points[b];
        points.push_back({(from[0] + to[0]) / 2, (from[1] + to[1]) / 2, (from[2] + to[2]) / 2});
        place.push_back(is_line(h) ? Place::kLine : Place::kSurface);
        first.push_back(-1);
        const int32_t second = halve(h, m), other = t < 0 ? -1 : halve(t, m);
        link(h, other);
        if (t >= 0) link(second, t);
        crease[second] = crease[h];
        if (t >= 0) crease[other] = crease[t];
        for (const int32_t each : {h, second, t, other})
            if (each >= 0) settle(start(each)), settle(end(each));
    }

    // Moves the end of h into its start, which stays where it is. Only where `can_collapse`.
    void collapse(int32_t h) {
        const int32_t a = start(h), b = end(h), t = twin[h];
        around(b, [&](int32_t out) { corner[out] = a; });
        const std::pair<int32_t, int32_t> one = close(h), other = t < 0 ? std::pair(-1, -1) : close(t);
        first[b] = -1;
        for (const auto& [low, high] : {one, other})
            for (const int32_t each : {low, high})
                if (each >= 0) first[start(each)] = each, first[end(each)] = next(each);
        for (const auto& [low, high] : {one, other})
            for (const int32_t each : {low, high})
                if (each >= 0) settle(start(each)), settle(end(each));
    }

    // Whether the surface stays what it is when the ends of h become one: only the corners opposite of the
    // edge are neighbours of both, and none of them is left without a triangle around it.
    bool can_collapse(int32_t h) const {
        const int32_t a = start(h), b = end(h), t = twin[h];
        if (t >= 0 && is_on_border(a) && is_on_border(b)) return false;
        // Two triangles that share two edges: with the one the other's outside would go.
        if (t >= 0 && start(prev(h)) == start(prev(t))) return false;
        for (const int32_t side : {h, t}) {
            if (side < 0) continue;
            if (twin[next(side)] < 0 && twin[prev(side)] < 0) return false;
            const int32_t opposite = start(prev(side));
            if (valence(opposite) <= 3) return false;
        }
        int common = 0;
        neighbours(a, [&](int32_t u) { neighbours(b, [&](int32_t v) { common += u == v; }); });
        return common == (t < 0 ? 1 : 2);
    }

    // The other diagonal of the two triangles at h, which is neither line nor border
    void flip(int32_t h) {
        const int32_t t = twin[h], n = next(h), p = prev(h), tn = next(t), tp = prev(t);
        const int32_t a = start(h), b = start(t), c = start(p), d = start(tp);
        const Outer of_n = outer(n), of_p = outer(p), of_tn = outer(tn), of_tp = outer(tp);
        corner[h] = d, corner[n] = c, corner[p] = a;
        corner[t] = c, corner[tn] = d, corner[tp] = b;
        attach(n, of_p), attach(p, of_tn), attach(tn, of_tp), attach(tp, of_n);
        first[a] = p, first[b] = tp, first[c] = n, first[d] = h;
        for (const int32_t v : {a, b, c, d}) settle(v);
    }

   private:
    struct Outer {
        int32_t twin;
        uint8_t crease;
    };

    std::vector<int32_t> split_;  // vertices that were separated

    Outer outer(int32_t h) const { return {twin[h], crease[h]}; }

    void attach(int32_t h, Outer to) {
        link(h, to.twin);
        crease[h] = to.crease;
    }

    void link(int32_t h, int32_t t) {
        twin[h] = t;
        if (t >= 0) twin[t] = h;
    }

    // Triangle of h = (a, b, c) becomes (a, m, c), a new one (m, b, c); returns the new half-edge m to b
    int32_t halve(int32_t h, int32_t m) {
        const int32_t n = next(h), b = start(n), c = start(prev(h)), added = size();
        for (const int32_t v : {m, b, c}) corner.push_back(v);
        twin.resize(corner.size(), -1);
        crease.resize(corner.size(), 0);
        corner[n] = m;
        attach(added + 1, outer(n));
        link(n, added + 2);
        crease[n] = 0;
        first[m] = added, first[b] = added + 1, first[start(h)] = h;
        return added;
    }

    // Removes the triangle of h and joins its two other edges; returns their half-edges outside
    std::pair<int32_t, int32_t> close(int32_t h) {
        const int32_t x = twin[next(h)], y = twin[prev(h)];
        const uint8_t line = crease[next(h)] | crease[prev(h)];
        if (x >= 0) twin[x] = y, crease[x] = line;
        if (y >= 0) twin[y] = x, crease[y] = line;
        for (int32_t k = h - h % 3, end = k + 3; k < end; ++k) corner[k] = -1, twin[k] = -1;
        return {x, y};
    }

    // first[v] back to the border, where there is one
    void settle(int32_t v) {
        int32_t h = first[v];
        while (twin[h] >= 0) {
            h = next(twin[h]);
            if (h == first[v]) return;
        }
        first[v] = h;
    }

    std::vector<int32_t> twins(int32_t n) const {
        std::vector<int32_t> begin(n + 1, 0), of_low(corner.size()), found(corner.size(), -1);
        const auto low = [&](int32_t h) { return std::min(start(h), end(h)); };
        for (int32_t h = 0; h < size(); ++h) ++begin[low(h) + 1];
        for (int32_t v = 0; v < n; ++v) begin[v + 1] += begin[v];
        std::vector<int32_t> fill(begin.begin(), begin.end() - 1);
        for (int32_t h = 0; h < size(); ++h) of_low[fill[low(h)]++] = h;
        for (int32_t h = 0; h < size(); ++h) {
            int32_t same = 0, opposite = -1;
            for (int32_t k = begin[low(h)]; k < begin[low(h) + 1]; ++k) {
                const int32_t other = of_low[k];
                if (std::max(start(other), end(other)) != std::max(start(h), end(h))) continue;
                ++same;
                if (start(other) == end(h)) opposite = other;
            }
            if (same == 2) found[h] = opposite;
        }
        return found;
    }

    void separate_fans() {
        std::vector<uint8_t> seen(corner.size(), 0);
        for (int32_t h = 0; h < size(); ++h) {
            if (seen[h]) continue;
            int32_t begin = h;
            while (twin[begin] >= 0 && next(twin[begin]) != h) begin = next(twin[begin]);
            int32_t v = start(h);
            const bool taken = first[v] >= 0;
            if (taken) {
                split_.push_back(v);
                points.push_back(points[v]);
                first.push_back(-1);
                v = static_cast<int32_t>(points.size()) - 1;
                split_.push_back(v);
            }
            first[v] = begin;
            int32_t out = begin;
            do {
                seen[out] = 1;
                corner[out] = v;
                out = twin[prev(out)];
            } while (out >= 0 && out != begin);
        }
    }
};

}  // namespace cusp
