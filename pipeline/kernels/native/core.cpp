// Python binding of the exact geodesics: array arguments and results, searches on threads without the GIL.
#include <nanobind/stl/function.h>
#include <nanobind/stl/tuple.h>
#include <nanobind/stl/unique_ptr.h>

#include <memory>

#include "bridge.hpp"
#include "checks.hpp"
#include "geodesic_mesh.hpp"
#include "pair_columns.hpp"
#include "window_search.hpp"

namespace nb = nanobind;
using namespace nb::literals;

namespace {

using cusp::check_count;
using cusp::check_indices;
using cusp::GeodesicMesh;
using cusp::In1;
using cusp::In2;
using cusp::OnProgress;
using cusp::Out1;
using cusp::Out2;
using cusp::Pair;
using cusp::PairColumns;
using cusp::Progress;
using cusp::progress_callback;
using cusp::to_columns;
using cusp::to_numpy;
using cusp::WindowSearch;

class Solver {
   public:
    Solver(const In2<int32_t>& faces, const In2<double>& lengths, int32_t n)
        : mesh_(n, checked(faces, lengths, n), lengths.data(), static_cast<int32_t>(faces.shape(0))) {}

    Out2<double> distances(const In1<int64_t>& sources, double radius, int threads,
                           const Progress& progress) {
        const auto count = static_cast<int64_t>(sources.shape(0));
        check(sources);
        check_radius(radius);
        auto* rows = new std::vector<double>(static_cast<size_t>(count) * mesh_.n, cusp::kInfinity);
        const nb::capsule owner(rows, [](void* p) noexcept { delete static_cast<std::vector<double>*>(p); });
        const OnProgress on_progress = progress_callback(progress);
        {
            const nb::gil_scoped_release no_gil;
            over_sources(count, threads, on_progress, [&](WindowSearch& search, int64_t i) {
                double* row = rows->data() + i * mesh_.n;
                search.run(static_cast<int32_t>(sources.data()[i]), radius, [&](int32_t v, double d) {
                    row[v] = d;
                    return radius;
                });
            });
        }
        return Out2<double>(rows->data(), {static_cast<size_t>(count), static_cast<size_t>(mesh_.n)}, owner);
    }

    // Distance of every vertex to the nearest of `sources`; inf beyond `radius`.
    Out1<double> distances_from_set(const In1<int64_t>& sources, double radius) {
        check(sources);
        check_radius(radius);
        std::vector<double> row(mesh_.n, cusp::kInfinity);
        {
            const nb::gil_scoped_release no_gil;
            WindowSearch search(mesh_);
            search.run(sources.data(), sources.data() + sources.shape(0), radius, [&](int32_t v, double d) {
                row[v] = d;
                return radius;
            });
        }
        return to_numpy(std::move(row));
    }

    // Distance from sources[i] to targets[i]; inf beyond bounds[i]. Each search stops at its target.
    Out1<double> between(const In1<int64_t>& sources, const In1<int64_t>& targets, const In1<double>& bounds,
                         int threads, const Progress& progress) {
        check(sources);
        check(targets);
        const auto count = static_cast<int64_t>(sources.shape(0));
        if (targets.shape(0) != sources.shape(0) || bounds.shape(0) != sources.shape(0))
            throw std::invalid_argument("sources, targets and bounds must have one length");
        std::for_each_n(bounds.data(), count, check_radius);
        std::vector<double> distance(count, cusp::kInfinity);
        const OnProgress on_progress = progress_callback(progress);
        {
            const nb::gil_scoped_release no_gil;
            over_sources(count, threads, on_progress, [&](WindowSearch& search, int64_t i) {
                const double bound = bounds.data()[i];
                search.run(static_cast<int32_t>(sources.data()[i]), bound, [&](int32_t v, double d) {
                    if (v != targets.data()[i]) return bound;
                    distance[i] = d;
                    return -1.0;
                });
            });
        }
        return to_numpy(std::move(distance));
    }

    // Vertices within `radius` of each source, without the source: (counts, vertices in ascending order,
    // distances). The distances are from the source, not canonical.
    PairColumns balls(const In1<int64_t>& sources, double radius, int threads, const Progress& progress) {
        check(sources);
        check_radius(radius);
        std::vector<std::vector<Pair>> rows(sources.shape(0));
        const OnProgress on_progress = progress_callback(progress);
        {
            const nb::gil_scoped_release no_gil;
            over_sources(static_cast<int64_t>(rows.size()), threads, on_progress,
                         [&](WindowSearch& search, int64_t i) {
                             rows[i] = ball(search, static_cast<int32_t>(sources.data()[i]), radius);
                         });
        }
        return to_columns(std::move(rows));
    }

    // For each vertex the number of vertices nearer than `low` and the sum of their weights times a kernel
    // (1, or exp(-(d / scale)^2) if scale > 0), in ascending order of distance. The pairs with low <= d
    // <= high are listed, since both ends decide whether a pair at a limit counts: (counts, sums, i, j, d).
    std::tuple<Out1<int64_t>, Out1<double>, Out1<int32_t>, Out1<int32_t>, Out1<double>> sums(
        const In1<double>& weights, double low, double high, double scale, int threads,
        const Progress& progress) {
        if (static_cast<int32_t>(weights.shape(0)) != mesh_.n)
            throw std::invalid_argument("weights must be (n,)");
        cusp::check_finite(weights, "weights");
        for (const double each : {low, high, scale}) check_radius(each);
        std::vector<int64_t> nearer(mesh_.n, 0);
        std::vector<double> sum(mesh_.n, 0.0);
        std::vector<std::vector<Pair>> undecided(mesh_.n);
        std::vector<int32_t> from, to;
        std::vector<double> distance;
        const OnProgress on_progress = progress_callback(progress);
        {
            const nb::gil_scoped_release no_gil;
            over_sources(mesh_.n, threads, on_progress, [&](WindowSearch& search, int64_t i) {
                const auto source = static_cast<int32_t>(i);
                search.run(source, high, [&](int32_t v, double d) {
                    if (v == source) return high;
                    if (d >= low) {
                        undecided[i].push_back({v, d});
                    } else {
                        const double ratio = scale > 0 ? d / scale : 0.0;
                        sum[i] += weights.data()[v] * (scale > 0 ? std::exp(-ratio * ratio) : 1.0);
                        ++nearer[i];
                    }
                    return high;
                });
                undecided[i].shrink_to_fit();
            });
            for (int32_t i = 0; i < mesh_.n; ++i) {
                for (const Pair& pair : undecided[i]) {
                    from.push_back(i);
                    to.push_back(pair.vertex);
                    distance.push_back(pair.distance);
                }
                std::vector<Pair>().swap(undecided[i]);
            }
        }
        return {to_numpy(std::move(nearer)), to_numpy(std::move(sum)), to_numpy(std::move(from)),
                to_numpy(std::move(to)), to_numpy(std::move(distance))};
    }

    // For each source the nearest vertex of smaller rank, and all further ones within the relative distance
    // `slack` of it: (counts, vertices, distances). Each search stops there.
    PairColumns nearest_denser(const In1<int64_t>& sources, const In1<int64_t>& rank, double slack,
                               int threads, const Progress& progress) {
        if (static_cast<int32_t>(rank.shape(0)) != mesh_.n) throw std::invalid_argument("rank must be (n,)");
        const int64_t* r = rank.data();
        return nearest_where(sources, cusp::kInfinity, slack, threads, progress,
                             [r](int32_t source, int32_t v) { return r[v] < r[source]; });
    }

    // The same for vertices with a different label >= 0, out to `radius`.
    PairColumns nearest_other(const In1<int64_t>& sources, const In1<int32_t>& labels, double radius,
                              double slack, int threads, const Progress& progress) {
        if (static_cast<int32_t>(labels.shape(0)) != mesh_.n)
            throw std::invalid_argument("labels must be (n,)");
        const int32_t* label = labels.data();
        return nearest_where(sources, radius, slack, threads, progress, [label](int32_t source, int32_t v) {
            return label[v] >= 0 && label[v] != label[source];
        });
    }

    // Distances of the `most` nearest vertices of each source in ascending order, one row per source; inf if
    // there are fewer.
    Out2<double> nearest(const In1<int64_t>& sources, int64_t most, int threads) {
        const auto count = static_cast<int64_t>(sources.shape(0));
        check(sources);
        if (most < 0 || most > mesh_.n) throw std::invalid_argument("most must be in [0, n]");
        auto* rows = new std::vector<double>(static_cast<size_t>(count * most), cusp::kInfinity);
        const nb::capsule owner(rows, [](void* p) noexcept { delete static_cast<std::vector<double>*>(p); });
        {
            const nb::gil_scoped_release no_gil;
            over_sources(count, threads, {}, [&](WindowSearch& search, int64_t i) {
                int64_t seen = -1;  // the source is not counted
                search.run(static_cast<int32_t>(sources.data()[i]), cusp::kInfinity, [&](int32_t, double d) {
                    if (seen >= 0) (*rows)[i * most + seen] = d;
                    return ++seen < most ? cusp::kInfinity : -1.0;
                });
            });
        }
        return Out2<double>(rows->data(), {static_cast<size_t>(count), static_cast<size_t>(most)}, owner);
    }

    // Number of windows that a search from `source` creates: a measure of its cost.
    int64_t windows(int32_t source, double radius) {
        if (source < 0 || source >= mesh_.n) throw std::out_of_range("source out of range");
        check_radius(radius);
        WindowSearch search(mesh_);
        search.run(source, radius, [radius](int32_t, double) { return radius; });
        return search.windows_made();
    }

   private:
    template <class Wanted>
    PairColumns nearest_where(const In1<int64_t>& sources, double radius, double slack, int threads,
                              const Progress& progress, Wanted&& wanted) {
        check(sources);
        check_radius(radius);
        check_radius(slack);
        std::vector<std::vector<Pair>> rows(sources.shape(0));
        const OnProgress on_progress = progress_callback(progress);
        {
            const nb::gil_scoped_release no_gil;
            over_sources(static_cast<int64_t>(rows.size()), threads, on_progress,
                         [&](WindowSearch& search, int64_t i) {
                             const auto source = static_cast<int32_t>(sources.data()[i]);
                             double limit = radius;
                             search.run(source, radius, [&](int32_t v, double d) {
                                 if (wanted(source, v)) {
                                     if (rows[i].empty()) limit = std::min(limit, d * (1 + slack));
                                     rows[i].push_back({v, d});
                                 }
                                 return limit;
                             });
                         });
        }
        return to_columns(std::move(rows));
    }

    std::vector<Pair> ball(WindowSearch& search, int32_t source, double radius) const {
        std::vector<Pair> pairs;
        search.run(source, radius, [&](int32_t v, double d) {
            if (v != source) pairs.push_back({v, d});
            return radius;
        });
        std::sort(pairs.begin(), pairs.end(),
                  [](const Pair& a, const Pair& b) { return a.vertex < b.vertex; });
        return pairs;
    }

    template <class Work>
    void over_sources(int64_t count, int threads, const OnProgress& on_progress, Work&& work) {
        threads = cusp::checked_threads(threads);
        std::vector<std::unique_ptr<WindowSearch>> searches(threads);
        cusp::for_each(count, threads, on_progress, [&](int worker, int64_t item) {
            auto& search = searches[worker];
            if (!search) search = std::make_unique<WindowSearch>(mesh_);
            work(*search, item);
        });
    }

    static const int32_t* checked(const In2<int32_t>& faces, const In2<double>& lengths, int32_t n) {
        if (n < 0) throw std::invalid_argument("n must not be negative");
        check_count(n, "vertices");
        cusp::check_faces(faces, n);
        cusp::check_rows(lengths, faces.shape(0), "lengths must be (m, 3), as the faces");
        if (std::any_of(lengths.data(), lengths.data() + lengths.size(),
                        [](double each) { return each < 0; }))
            throw std::invalid_argument("lengths must not be negative");
        return faces.data();
    }

    void check(const In1<int64_t>& sources) const { check_indices(sources, mesh_.n, "source"); }

    // Infinite is allowed: everywhere.
    static void check_radius(double radius) {
        if (std::isnan(radius)) throw std::invalid_argument("radius is not a number");
    }

    GeodesicMesh mesh_;
};

}  // namespace

void bind_copy_icp(nb::module_& m);      // copy_icp.cpp
void bind_edges(nb::module_& m);         // edges.cpp
void bind_fpfh(nb::module_& m);          // fpfh.cpp
void bind_icp(nb::module_& m);           // icp.cpp
void bind_nearest_grid(nb::module_& m);  // nearest_grid.cpp
void bind_poses(nb::module_& m);         // poses.cpp
void bind_raster(nb::module_& m);        // raster.cpp
void bind_remesh(nb::module_& m);        // remesh.cpp

NB_MODULE(core, m) {
    m.doc() = "C++ core of kernels/geodesics.py, kernels/copy_icp.py and kernels/surface.py.";
    nb::register_exception_translator([](const std::exception_ptr& p, void*) {
        try {
            std::rethrow_exception(p);
        } catch (const cusp::Cancelled&) {
            PyErr_SetString(PyExc_InterruptedError, "the progress callback returned False");
        }
    });
    nb::class_<Solver>(m, "Solver")
        .def(nb::init<const In2<int32_t>&, const In2<double>&, int32_t>(), "faces"_a, "lengths"_a, "n"_a)
        .def("distances", &Solver::distances, "sources"_a, "radius"_a, "threads"_a, "progress"_a = nb::none())
        .def("distances_from_set", &Solver::distances_from_set, "sources"_a, "radius"_a)
        .def("between", &Solver::between, "sources"_a, "targets"_a, "bounds"_a, "threads"_a,
             "progress"_a = nb::none())
        .def("balls", &Solver::balls, "sources"_a, "radius"_a, "threads"_a, "progress"_a = nb::none())
        .def("sums", &Solver::sums, "weights"_a, "low"_a, "high"_a, "scale"_a, "threads"_a,
             "progress"_a = nb::none())
        .def("nearest_denser", &Solver::nearest_denser, "sources"_a, "rank"_a, "slack"_a, "threads"_a,
             "progress"_a = nb::none())
        .def("nearest_other", &Solver::nearest_other, "sources"_a, "labels"_a, "radius"_a, "slack"_a,
             "threads"_a, "progress"_a = nb::none())
        .def("nearest", &Solver::nearest, "sources"_a, "most"_a, "threads"_a)
        .def("windows", &Solver::windows, "source"_a, "radius"_a);
    bind_copy_icp(m);
    bind_icp(m);
    bind_nearest_grid(m);
    bind_edges(m);
    bind_fpfh(m);
    bind_poses(m);
    bind_raster(m);
    bind_remesh(m);
}
