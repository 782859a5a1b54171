// Isotropic remeshing: the same surface in nearly equilateral triangles of one size.
//
// Botsch & Kobbelt, "A remeshing approach to multiresolution modeling" (2004): each pass splits long edges,
// collapses short ones, flips edges towards six neighbours a vertex, and moves vertices along the surface to
// the middle of their neighbours, then onto the surface that was given. Creases and borders stay: their
// vertices move along them, those where they meet or turn do not move.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <memory>
#include <numeric>
#include <utility>
#include <vector>

#include "half_edges.hpp"
#include "parallel.hpp"
#include "surface_tree.hpp"

namespace cusp {

class Remesher {
   public:
    // edge : mm; crease_deg : edges with a larger angle between their triangles are kept
    Remesher(const double* vertices, int32_t n, const int32_t* faces, int32_t m, double edge,
             double crease_deg, int threads)
        : mesh_(vertices, n, faces, m),
          surface_(vertices, faces, m),
          edge_(edge),
          threads_(threads),
          min_cosine_(std::cos(crease_deg * kPi / 180)),
          hint_(mesh_.points.size(), -1) {
        mark_creases();
        mark_places();
        keep_lines();
    }

    void run(int passes) {
        for (int pass = 0; pass < passes; ++pass) {
            split_long();
            collapse_short();
            flip_all();
            relax();
        }
    }

    // The vertices that are used (n, 3), and the triangles (m, 3)
    std::pair<std::vector<double>, std::vector<int32_t>> result() const {
        std::vector<double> vertices;
        std::vector<int32_t> faces, number(mesh_.points.size(), -1);
        for (int32_t h = 0; h < mesh_.size(); ++h) {
            const int32_t v = mesh_.corner[h];
            if (v < 0) continue;
            if (number[v] < 0) {
                number[v] = static_cast<int32_t>(vertices.size() / 3);
                vertices.insert(vertices.end(), mesh_.points[v].begin(), mesh_.points[v].end());
            }
            faces.push_back(number[v]);
        }
        return {std::move(vertices), std::move(faces)};
    }

   private:
    static constexpr double kPi = 3.14159265358979323846;
    // Of the length asked for: longer edges are split, shorter ones collapsed. From the paper: halves of the
    // one and doubles of the other are then nearer to it.
    static constexpr double kLong = 4.0 / 3, kShort = 4.0 / 5;
    // A line that turns by more than this has a corner there, degrees. Chosen by hand, not fitted.
    static constexpr double kTurnDeg = 45;
    // Creases that hang together are no line when they are shorter than so many edges. Chosen by hand.
    static constexpr double kShortLine = 1;
    // An edge shorter than this share of the length asked for is collapsed wherever it lies: a needle between
    // two corners has no normal, and its vertices a curvature without bounds. Chosen by hand, on meshes of
    // CAD.
    static constexpr double kTiny = 0.1;
    // Sweeps of collapses in a pass, at most, and the share of the edges below which no further one is made.
    // Chosen by hand: the next pass goes on.
    static constexpr int kSweeps = 4;
    static constexpr double kFew = 0.02;
    // Edges are split together whose squared length is at least this share of the longest one's. By hand.
    static constexpr double kAlike = 0.5;
    // Cosine of the largest angle by which a triangle may turn in one change (60 degrees). Chosen by hand.
    static constexpr double kMinTurnCosine = 0.5;
    // A flip for the number of neighbours may cost this share of the worse triangle's quality; one for the
    // quality alone must gain as much. Chosen by hand.
    static constexpr double kQualityShare = 0.6;
    // Distance of the new edge from the old one, as a share of the length asked for, up to which an edge is
    // flipped. Derived: that of two equilateral triangles with the longest edges that are not split, at the
    // largest angle at which both may turn into one plane (`kMinTurnCosine`). So it stops only the flips of
    // longer triangles, which leave the surface by far more at the same angle.
    static constexpr double kApart = 1.0;
    // No flip and no move makes a triangle worse than `kMinQuality`, unless it was, and no collapse worse
    // than `kFlat`: needles must go. Chosen by hand.
    static constexpr double kMinQuality = 0.1, kFlat = 0.01;
    // Flips for each edge that is looked at, at most: they could go round in a circle. Chosen by hand.
    static constexpr int64_t kFlips = 4;
    static constexpr int32_t kUnknown = std::numeric_limits<int32_t>::max();

    HalfEdges mesh_;
    SurfaceTree surface_;
    std::unique_ptr<SurfaceTree> lines_;  // creases and borders as triangles without area; null without any
    double edge_;
    int threads_;
    double min_cosine_;
    std::vector<int32_t> hint_;  // of a vertex: a face of the surface, or of the lines, that is near

    static double cosine(const Vec& a, const Vec& b) {
        const double size = std::sqrt(dot(a, a) * dot(b, b));
        return size > 0 ? dot(a, b) / size : 1;
    }

    static Vec plus(const Vec& a, const Vec& b, double factor = 1) {
        return {a[0] + factor * b[0], a[1] + factor * b[1], a[2] + factor * b[2]};
    }

    void mark_creases() {
        HalfEdges& mesh = mesh_;
        for (int32_t h = 0; h < mesh.size(); ++h)
            if (!mesh.is_border(h) && cosine(mesh.normal(h), mesh.normal(mesh.twin[h])) < min_cosine_)
                mesh.crease[h] = 1;
        // What hangs together by creases, and how long it is
        std::vector<int32_t> parent(mesh.points.size());
        std::iota(parent.begin(), parent.end(), 0);
        const auto root = [&](int32_t v) {
            while (parent[v] != v) v = parent[v] = parent[parent[v]];
            return v;
        };
        for (int32_t h = 0; h < mesh.size(); ++h)
            if (mesh.is_line(h)) parent[root(mesh.end(h))] = root(mesh.start(h));
        std::vector<double> length(mesh.points.size(), 0);
        for (int32_t h = 0; h < mesh.size(); ++h)
            if (mesh.is_line(h) && mesh.is_edge(h))
                length[root(mesh.start(h))] += std::sqrt(mesh.length_sq(h));
        for (int32_t h = 0; h < mesh.size(); ++h)
            if (length[root(mesh.start(h))] < kShortLine * edge_) mesh.crease[h] = 0;
    }

    void mark_places() {
        const double straight = std::cos(kTurnDeg * kPi / 180);
        std::vector<int32_t> count(mesh_.points.size(), 0);
        std::vector<Vec> arrives(mesh_.points.size()), leaves(mesh_.points.size());
        for (int32_t h = 0; h < mesh_.size(); ++h) {
            if (!mesh_.is_line(h) || !mesh_.is_edge(h)) continue;
            for (const auto& [v, u] :
                 {std::pair(mesh_.start(h), mesh_.end(h)), std::pair(mesh_.end(h), mesh_.start(h))}) {
                const Vec away = minus(mesh_.points[u].data(), mesh_.points[v].data());
                if (count[v]++ == 0) {
                    arrives[v] = {-away[0], -away[1], -away[2]};
                } else {
                    leaves[v] = away;
                }
            }
        }
        for (size_t v = 0; v < count.size(); ++v) {
            if (mesh_.place[v] == Place::kCorner || count[v] == 0) continue;
            const bool is_line = count[v] == 2 && cosine(arrives[v], leaves[v]) >= straight;
            mesh_.place[v] = is_line ? Place::kLine : Place::kCorner;
        }
    }

    // The lines as they are now, for vertices that move along them
    void keep_lines() {
        std::vector<int32_t> faces;
        for (int32_t h = 0; h < mesh_.size(); ++h)
            if (mesh_.is_line(h) && mesh_.is_edge(h))
                for (const int32_t v : {mesh_.start(h), mesh_.end(h), mesh_.end(h)}) faces.push_back(v);
        if (!faces.empty())
            lines_ = std::make_unique<SurfaceTree>(mesh_.points[0].data(), faces.data(),
                                                   static_cast<int32_t>(faces.size() / 3));
    }

    // Longest first: in another order the triangles become needles, and far more of them.
    void split_long() {
        const double limit = kLong * edge_ * kLong * edge_;
        for (;;) {
            std::vector<std::pair<double, int32_t>> edges;
            for (int32_t h = 0; h < mesh_.size(); ++h)
                if (mesh_.is_alive(h) && mesh_.is_edge(h) && mesh_.length_sq(h) > limit)
                    edges.push_back({-mesh_.length_sq(h), h});
            if (edges.empty()) return;
            std::sort(edges.begin(), edges.end());
            const double longest = edges[0].first;
            std::vector<int32_t> changed;
            for (const auto& [minus_length_sq, h] : edges) {
                if (minus_length_sq > kAlike * longest) break;
                mesh_.split(h);
                hint_.push_back(hint_[mesh_.start(h)]);
                const int32_t middle = mesh_.end(h);
                mesh_.around(middle, [&](int32_t out) {
                    changed.push_back(out);
                    changed.push_back(HalfEdges::next(out));
                });
            }
            flip(changed);
        }
    }

    void collapse_short() {
        const double limit_sq = kShort * kShort * edge_ * edge_;
        for (int sweep = 0; sweep < kSweeps; ++sweep) {
            int64_t collapsed = 0, edges = 0;
            for (int32_t h = 0; h < mesh_.size(); ++h) {
                if (!mesh_.is_alive(h) || !mesh_.is_edge(h)) continue;
                ++edges;
                if (mesh_.length_sq(h) < limit_sq && collapse(h)) ++collapsed;
            }
            if (static_cast<double>(collapsed) < kFew * static_cast<double>(edges)) break;
        }
    }

    bool collapse(int32_t h) {
        const int32_t a = mesh_.start(h), b = mesh_.end(h);
        const Place at_a = mesh_.place[a], at_b = mesh_.place[b], freer = std::min(at_a, at_b);
        const bool is_held = freer == Place::kCorner || (freer == Place::kLine && !mesh_.is_line(h));
        if (is_held && mesh_.length_sq(h) > kTiny * kTiny * edge_ * edge_) return false;
        // What may move less stays where it is.
        const Vec along = minus(mesh_.points[b].data(), mesh_.points[a].data());
        Vec to = plus(mesh_.points[a], along, at_a > at_b || is_held ? 0 : at_b > at_a ? 1 : 0.5);
        if (at_a == at_b && !is_held)
            to = at_a == Place::kLine ? on_line(to, along) : on_surface(to, a, mesh_.normal(h));
        if (!mesh_.can_collapse(h)) return false;
        if (!stays_like_it(a, b, to) || !stays_like_it(b, a, to)) return false;
        mesh_.collapse(h);
        mesh_.points[a] = at_b > at_a ? mesh_.points[b] : to;
        mesh_.place[a] = is_held ? Place::kCorner : std::max(at_a, at_b);  // held: lines meet there now
        return true;
    }

    // Whether the triangles at v, but those at `other` too, keep their sides when v goes to `to`, and get no
    // long edge
    bool stays_like_it(int32_t v, int32_t other, const Vec& to) const {
        const double limit_sq = kLong * kLong * edge_ * edge_;
        bool fits = true;
        mesh_.around(v, [&](int32_t h) {
            const int32_t c = mesh_.end(h), d = mesh_.start(HalfEdges::prev(h));
            if (c == other || d == other) return;
            const Vec to_c = minus(mesh_.points[c].data(), to.data()),
                      to_d = minus(mesh_.points[d].data(), to.data());
            if (dot(to_c, to_c) > limit_sq || dot(to_d, to_d) > limit_sq) fits = false;
            const double then = quality(to, mesh_.points[c], mesh_.points[d]);
            if (then < kFlat && then < quality(mesh_.points[v], mesh_.points[c], mesh_.points[d]))
                fits = false;
            const Vec before = mesh_.normal(h), after = cross(to_c, to_d);
            const bool has_side = quality(mesh_.points[v], mesh_.points[c], mesh_.points[d]) >= kFlat;
            if (has_side &&
                !(dot(before, after) > kMinTurnCosine * std::sqrt(dot(before, before) * dot(after, after))))
                fits = false;
        });
        return fits;
    }

    // Looks at the edges of `waiting`, which it empties, and at those around an edge that was flipped
    void flip(std::vector<int32_t>& waiting) {
        std::vector<int32_t> missing(mesh_.points.size(),
                                     kUnknown);  // neighbours more (-) or fewer than ideal
        const auto missing_of = [&](int32_t v) -> int32_t& {
            if (missing[v] == kUnknown) missing[v] = (mesh_.is_on_border(v) ? 4 : 6) - mesh_.valence(v);
            return missing[v];
        };
        int64_t left = kFlips * static_cast<int64_t>(waiting.size());
        for (size_t k = 0; k < waiting.size() && left > 0; ++k) {
            const int32_t h = waiting[k];
            if (!mesh_.is_alive(h) || mesh_.is_line(h)) continue;
            const int32_t t = mesh_.twin[h];
            for (const int32_t v : {mesh_.start(h), mesh_.end(h), mesh_.start(HalfEdges::prev(h)),
                                    mesh_.start(HalfEdges::prev(t))})
                missing_of(v);
            if (!flip(h, missing)) continue;
            --left;
            for (const int32_t each :
                 {HalfEdges::next(h), HalfEdges::prev(h), HalfEdges::next(t), HalfEdges::prev(t)})
                waiting.push_back(each);
        }
        waiting.clear();
    }

    void flip_all() {
        std::vector<int32_t> all;
        for (int32_t h = 0; h < mesh_.size(); ++h)
            if (mesh_.is_alive(h) && mesh_.is_edge(h)) all.push_back(h);
        flip(all);
    }

    bool flip(int32_t h, std::vector<int32_t>& missing) {
        const int32_t t = mesh_.twin[h], a = mesh_.start(h), b = mesh_.end(h),
                      c = mesh_.start(HalfEdges::prev(h)), d = mesh_.start(HalfEdges::prev(t));
        const auto deviation = [](int32_t x, int32_t y, int32_t z, int32_t w) {
            return x * x + y * y + z * z + w * w;
        };
        const int32_t now = deviation(missing[a], missing[b], missing[c], missing[d]),
                      then = deviation(missing[a] + 1, missing[b] + 1, missing[c] - 1, missing[d] - 1);
        if (then > now) return false;
        const Vec &A = mesh_.points[a], &B = mesh_.points[b], &C = mesh_.points[c], &D = mesh_.points[d];
        const double worse_now = std::min(quality(A, B, C), quality(B, A, D)),
                     worse_then = std::min(quality(A, D, C), quality(D, B, C));
        if (then < now ? worse_then < kQualityShare * worse_now : worse_then * kQualityShare < worse_now)
            return false;
        if (worse_then < kMinQuality && worse_then <= worse_now) return false;
        if (distance_of_lines_sq(A, B, C, D) > kApart * kApart * edge_ * edge_) return false;
        const Vec side = plus(mesh_.normal(h), mesh_.normal(t));
        for (const Vec& after : {cross(minus(D.data(), A.data()), minus(C.data(), A.data())),
                                 cross(minus(B.data(), D.data()), minus(C.data(), D.data()))})
            if (!(dot(side, after) > kMinTurnCosine * std::sqrt(dot(side, side) * dot(after, after))))
                return false;
        if (c == d || mesh_.valence(a) <= 3 || mesh_.valence(b) <= 3 || mesh_.are_neighbours(c, d))
            return false;
        mesh_.flip(h);
        ++missing[a], ++missing[b], --missing[c], --missing[d];
        return true;
    }

    // Squared distance of the line through a and b from the one through c and d; 0 where they are parallel
    static double distance_of_lines_sq(const Vec& a, const Vec& b, const Vec& c, const Vec& d) {
        const Vec n = cross(minus(b.data(), a.data()), minus(d.data(), c.data()));
        const double size_sq = dot(n, n), across = dot(minus(c.data(), a.data()), n);
        return size_sq > 0 ? across * across / size_sq : 0;
    }

    // 1 for an equilateral triangle, 0 without area: area over that of the mean squared edge
    static double quality(const Vec& a, const Vec& b, const Vec& c) {
        const Vec ab = minus(b.data(), a.data()), bc = minus(c.data(), b.data()),
                  ca = minus(a.data(), c.data());
        const Vec n = cross(ab, bc);
        const double edges = dot(ab, ab) + dot(bc, bc) + dot(ca, ca);
        return edges > 0 ? 2 * std::sqrt(3.0) * std::sqrt(dot(n, n)) / edges : 0;
    }

    void relax() {
        const auto n = static_cast<int64_t>(mesh_.points.size());
        std::vector<Vec> before = mesh_.points, after = mesh_.points;
        const auto work = [&](int, int64_t v) {
            if (mesh_.first[v] < 0 || mesh_.place[v] == Place::kCorner) return;
            after[v] = mesh_.place[v] == Place::kLine ? along_line(static_cast<int32_t>(v))
                                                      : along_surface(static_cast<int32_t>(v));
        };
        for_each(n, threads_, {}, work, 256);
        mesh_.points = after;
        // A triangle that was turned over or squeezed goes back, until none is.
        for (bool turned = true; turned;) {
            turned = false;
            for (int32_t f = 0; f < mesh_.size(); f += 3) {
                if (!mesh_.is_alive(f)) continue;
                const int32_t* v = mesh_.corner.data() + f;
                if (!is_worse(before[v[0]], before[v[1]], before[v[2]], mesh_.points[v[0]],
                              mesh_.points[v[1]], mesh_.points[v[2]]))
                    continue;
                for (int k = 0; k < 3; ++k) {
                    turned |= mesh_.points[v[k]] != before[v[k]];
                    mesh_.points[v[k]] = before[v[k]];
                }
            }
        }
    }

    static bool is_worse(const Vec& a, const Vec& b, const Vec& c, const Vec& to_a, const Vec& to_b,
                         const Vec& to_c) {
        const Vec before = cross(minus(b.data(), a.data()), minus(c.data(), a.data())),
                  after = cross(minus(to_b.data(), to_a.data()), minus(to_c.data(), to_a.data()));
        const double then = quality(to_a, to_b, to_c);
        return !(dot(before, after) > 0) || (then < kMinQuality && then < quality(a, b, c));
    }

    Vec along_surface(int32_t v) {
        Vec middle{}, normal{};
        int count = 0;
        mesh_.neighbours(v, [&](int32_t u) { middle = plus(middle, mesh_.points[u]), ++count; });
        mesh_.around(v, [&](int32_t h) { normal = plus(normal, mesh_.normal(h)); });
        const double size_sq = dot(normal, normal);
        const Vec& here = mesh_.points[v];
        Vec step{};
        for (int k = 0; k < 3; ++k) step[k] = middle[k] / count - here[k];
        if (size_sq > 0) step = plus(step, normal, -dot(step, normal) / size_sq);
        const Vec there = plus(here, step);
        const Vec found = on_surface(there, v, normal);
        if (found != there) return found;
        return surface_.closest(here.data(), hint_[v]).point;
    }

    // The closest point of the surface; p itself where that is on another side of a thin wall
    Vec on_surface(const Vec& p, int32_t v, const Vec& normal) {
        const SurfacePoint found = surface_.closest(p.data(), hint_[v]);
        if (!(dot(surface_.normal(found.face), normal) > 0)) return p;
        hint_[v] = found.face;
        return found.point;
    }

    // The closest point of the lines; p itself where that is farther than `reach` is long: another line
    Vec on_line(const Vec& p, const Vec& reach) const {
        if (!lines_) return p;
        const SurfacePoint found = lines_->closest(p.data(), -1);
        return found.distance_sq <= dot(reach, reach) ? found.point : p;
    }

    Vec along_line(int32_t v) {
        std::vector<Vec> others;
        mesh_.around(v, [&](int32_t h) {
            if (mesh_.is_line(h)) others.push_back(mesh_.points[mesh_.end(h)]);
            const int32_t in = HalfEdges::prev(h);
            if (mesh_.is_border(in)) others.push_back(mesh_.points[mesh_.start(in)]);
        });
        const Vec& here = mesh_.points[v];
        if (others.size() != 2) return here;
        const Vec there{(others[0][0] + others[1][0]) / 2, (others[0][1] + others[1][1]) / 2,
                        (others[0][2] + others[1][2]) / 2};
        return on_line(there, minus(others[0].data(), others[1].data()));
    }
};

}  // namespace cusp
