// Triangle mesh for window propagation: half-edges, intrinsic edge lengths, vertices at which shortest paths
// may bend.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <numbers>
#include <numeric>
#include <stdexcept>
#include <vector>

namespace cusp {

// The faces around a vertex: a disc, a half disc at a border, or anything else (no face, bow tie, edge of
// three faces).
enum class Fan : uint8_t { closed, open, other };

inline double norm(double x, double y) {
    return std::sqrt(x * x + y * y);
}  // std::hypot is three times slower

// Half-edge h = 3 f + k is the edge of face f opposite its corner k, from corner k + 1 to corner k + 2. Its
// frame: start vertex at the origin, end vertex at (length, 0), the opposite vertex of f at (ox, oy) with oy
// >= 0. The record fills one cache line.
struct alignas(64) HalfEdge {
    double length, per_length, ox, oy;  // per_length : 1 / length, 0 if there is no length
    int32_t start, end, opposite;       // vertices
    int32_t at_start, at_end;           // half-edges of the same face whose opposite vertex is start, end
    int32_t across;  // the half-edge of the adjacent face; -1 if there is none, or more than one
};

struct GeodesicMesh {
    int32_t n = 0;
    int32_t m = 0;
    std::vector<int32_t> corner;        // (3 m) vertex at corner k of face f
    std::vector<HalfEdge> edges;        // (3 m)
    std::vector<int32_t> across_begin;  // (3 m + 1) into `across`
    std::vector<int32_t> across;        // the half-edges of other faces on the same edge
    std::vector<int32_t> star_begin;    // (n + 1) into `star`
    std::vector<int32_t> star;          // half-edges opposite the vertex: one per incident face
    std::vector<Fan> fan;               // (n)
    std::vector<double> total_angle;    // (n) sum of the face angles, radians
    std::vector<uint8_t>
        bends;  // (n) whether a shortest path may bend here: more than a full turn, or a border
    // Directions v -> start and v -> end at the opposite vertex v of each half-edge, radians, measured along
    // the fan of v from one of its edges; only if the fan is `closed` or `open`.
    std::vector<double> towards_start, towards_end;

    // faces (m, 3) with indices in [0, n); lengths (m, 3) of the edge opposite each corner, finite and >= 0.
    // Faces with a repeated vertex are ignored. An edge of more than two faces is a border of each of them:
    // paths run along it and through its ends, not across it (clean meshes have no such edge).
    GeodesicMesh(int32_t n_vertices, const int32_t* faces, const double* lengths, int32_t n_faces)
        : n(n_vertices) {
        for (int32_t f = 0; f < n_faces; ++f) {
            const int32_t* v = faces + 3 * int64_t{f};
            if (v[0] == v[1] || v[1] == v[2] || v[2] == v[0]) continue;
            for (int k = 0; k < 3; ++k) {
                if (v[k] < 0 || v[k] >= n) throw std::invalid_argument("face index out of range");
                corner.push_back(v[k]);
                length.push_back(lengths[3 * f + k]);
            }
            ++m;
        }
        join_faces();
        unfold_faces();
        find_stars();
        lay_out_fans();
        for (int32_t h = 0; h < 3 * m; ++h) {
            const int32_t sides = across_begin[h + 1] - across_begin[h];
            const int32_t over = sides == 1 ? across[across_begin[h]] : -1;
            const int32_t f = 3 * (h / 3);
            edges.push_back({length[h], length[h] > 0 ? 1.0 / length[h] : 0.0, ox[h], oy[h], start(h), end(h),
                             corner[h], f + (h % 3 + 1) % 3, f + (h % 3 + 2) % 3, over});
        }
    }

   private:
    int32_t start(int32_t h) const { return corner[3 * (h / 3) + (h % 3 + 1) % 3]; }
    int32_t end(int32_t h) const { return corner[3 * (h / 3) + (h % 3 + 2) % 3]; }
    int32_t opposite(int32_t h) const { return corner[h]; }

    std::vector<double> length, ox, oy;  // (3 m)
    std::vector<int32_t> edge_of;        // (3 m) number of the undirected edge
    std::vector<int32_t> edge_faces;

    void join_faces() {
        std::vector<int32_t> order(3 * static_cast<size_t>(m));
        std::iota(order.begin(), order.end(), 0);
        auto key = [this](int32_t h) {
            const int32_t a = start(h), b = end(h);
            return (static_cast<uint64_t>(std::min(a, b)) << 32U) | static_cast<uint32_t>(std::max(a, b));
        };
        std::vector<uint64_t> keys(order.size());
        for (size_t h = 0; h < keys.size(); ++h) keys[h] = key(static_cast<int32_t>(h));
        std::sort(order.begin(), order.end(),
                  [&keys](int32_t a, int32_t b) { return keys[a] != keys[b] ? keys[a] < keys[b] : a < b; });
        edge_of.assign(order.size(), 0);
        std::vector<int32_t> count(order.size() + 1, 0);
        std::vector<std::pair<int32_t, int32_t>> group(order.size());
        for (size_t first = 0; first < order.size();) {
            size_t last = first;
            while (last < order.size() && keys[order[last]] == keys[order[first]]) ++last;
            for (size_t i = first; i < last; ++i) {
                length[order[i]] =
                    length[order[first]];  // bitwise the same length for all half-edges of an edge
                edge_of[order[i]] = static_cast<int32_t>(edge_faces.size());
                group[order[i]] = {static_cast<int32_t>(first), static_cast<int32_t>(last)};
            }
            edge_faces.push_back(static_cast<int32_t>(last - first));
            first = last;
        }
        across_begin.assign(order.size() + 1, 0);
        for (size_t h = 0; h < order.size(); ++h) {
            for (int32_t i = group[h].first; i < group[h].second; ++i)
                if (order[i] != static_cast<int32_t>(h)) across.push_back(order[i]);
            across_begin[h + 1] = static_cast<int32_t>(across.size());
        }
    }

    void unfold_faces() {
        ox.resize(length.size());
        oy.resize(length.size());
        for (int32_t h = 0; h < 3 * m; ++h) {
            const int32_t f = 3 * (h / 3);
            const double base = length[h], from_start = length[f + (h % 3 + 2) % 3],
                         from_end = length[f + (h % 3 + 1) % 3];
            // (s^2 - e^2) as a product avoids cancellation on needle-shaped triangles
            ox[h] = base > 0 ? 0.5 * (base + (from_start - from_end) * (from_start + from_end) / base) : 0.0;
            // Kahan's stable triangle area for sides a >= b >= c; 0 if rounding violates the triangle
            // inequality
            double a = base, b = from_start, c = from_end;
            if (a < b) std::swap(a, b);
            if (b < c) std::swap(b, c);
            if (a < b) std::swap(a, b);
            const double squared = (a + (b + c)) * (c - (a - b)) * (c + (a - b)) * (a + (b - c));
            oy[h] = base > 0 && squared > 0 ? 0.5 * std::sqrt(squared) / base : 0.0;
        }
    }

    void find_stars() {
        star_begin.assign(static_cast<size_t>(n) + 1, 0);
        for (int32_t v : corner) ++star_begin[v + 1];
        std::partial_sum(star_begin.begin(), star_begin.end(), star_begin.begin());
        star.resize(corner.size());
        std::vector<int32_t> next(star_begin.begin(), star_begin.end() - 1);
        for (int32_t h = 0; h < 3 * m; ++h) star[next[corner[h]]++] = h;
    }

    void lay_out_fans() {
        fan.assign(n, Fan::other);
        total_angle.assign(n, 0.0);
        towards_start.assign(corner.size(), 0.0);
        towards_end.assign(corner.size(), 0.0);
        std::vector<uint8_t> irregular(n, 0), on_border(n, 0);
        for (int32_t h = 0; h < 3 * m; ++h) {
            const int32_t sides = edge_faces[edge_of[h]];
            if (sides == 1) on_border[start(h)] = on_border[end(h)] = 1;
            if (sides > 2) irregular[start(h)] = irregular[end(h)] = 1;
            if (!(length[h] > 0) || !(oy[h] > 0))
                irregular[start(h)] = irregular[end(h)] = irregular[opposite(h)] = 1;
        }
        for (int32_t v = 0; v < n; ++v)
            if (!irregular[v] && lay_out_fan(v)) fan[v] = on_border[v] ? Fan::open : Fan::closed;
        bends.assign(n, 1);
        // Below this excess (radians) the tolerance of the adjacent windows covers a path through the vertex.
        constexpr double kFlat = 1e-11;
        for (int32_t v = 0; v < n; ++v)
            if (fan[v] == Fan::closed && total_angle[v] <= 2 * std::numbers::pi + kFlat) bends[v] = 0;
    }

    // Walk around v from edge to edge and sum the angles; false if the walk does not visit all its faces.
    bool lay_out_fan(int32_t v) {
        const int32_t first = star_begin[v], count = star_begin[v + 1] - first;
        if (count == 0) return false;
        int32_t h = star[first];
        bool from_start = true;  // the walk enters a face through edge v -> start and leaves through v ->
                                 // end, or vice versa
        for (int32_t i = 0; i < count; ++i) {  // begin at a border if there is one
            const bool at_start = across_side(star[first + i], true) < 0;
            if (at_start || across_side(star[first + i], false) < 0) {
                h = star[first + i];
                from_start = at_start;
                break;
            }
        }
        double angle = 0.0;
        int32_t visited = 0;
        const int32_t begin = h;
        while (h >= 0) {
            const double corner_angle = angle_at(h);
            towards_start[h] = from_start ? angle : angle + corner_angle;
            towards_end[h] = from_start ? angle + corner_angle : angle;
            angle += corner_angle;
            if (++visited > count) return false;
            const int32_t leaves_to = from_start ? end(h) : start(h);
            const int32_t next = across_side(h, !from_start);
            if (next < 0) break;
            from_start = start(next) == leaves_to;
            h = next;
            if (h == begin) break;
        }
        total_angle[v] = angle;
        return visited == count;
    }

    // Angle at the opposite vertex of h, from the frame of the half-edge that starts there.
    double angle_at(int32_t h) const {
        const int32_t starts_there = 3 * (h / 3) + (h % 3 + 2) % 3;
        return std::atan2(oy[starts_there], ox[starts_there]);
    }

    // The half-edge opposite the same vertex in the face across the edge to start (or to end) of h; -1 at a
    // border.
    int32_t across_side(int32_t h, bool side_of_start) const {
        const int32_t v = corner[h], side = 3 * (h / 3) + (h % 3 + (side_of_start ? 2 : 1)) % 3;
        if (across_begin[side + 1] - across_begin[side] != 1) return -1;
        const int32_t other = across[across_begin[side]], f = 3 * (other / 3);
        for (int k = 0; k < 3; ++k)
            if (corner[f + k] == v) return f + k;
        return -1;
    }
};

}  // namespace cusp
