// Python binding of the isotropic remeshing.
#include <nanobind/stl/tuple.h>

#include <cmath>
#include <stdexcept>
#include <tuple>

#include "bridge.hpp"
#include "remesher.hpp"
#include "rows.hpp"

namespace nb = nanobind;
using namespace nb::literals;

namespace {

using cusp::In2;
using cusp::Out2;

constexpr double kMostEdges = 5e7;  // pieces that the edges of the mesh are split into, at most

// The sum of the lengths of the sides of the faces
double edges_of(const In2<double>& vertices, const In2<int32_t>& faces) {
    double sum = 0;
    for (size_t f = 0; f < faces.shape(0); ++f)
        for (int k = 0; k < 3; ++k) {
            const cusp::Point a = cusp::row(vertices, faces.data()[3 * f + k]),
                              b = cusp::row(vertices, faces.data()[3 * f + (k + 1) % 3]);
            sum += std::hypot(a[0] - b[0], a[1] - b[1], a[2] - b[2]);
        }
    return sum;
}

// vertices (n', 3) and faces (m', 3) of the same surface with edges of about `edge`
std::tuple<Out2<double>, Out2<int32_t>> isotropic(const In2<double>& vertices, const In2<int32_t>& faces,
                                                  double edge, double crease_deg, int passes, int threads) {
    cusp::check_rows(vertices, vertices.shape(0), "vertices must be (n, 3)");
    cusp::check_faces(faces, static_cast<int64_t>(vertices.shape(0)));
    if (faces.shape(0) == 0) throw std::invalid_argument("faces must be (m, 3), m > 0");
    if (!(edge > 0)) throw std::invalid_argument("the edge length must be positive");
    cusp::check_finite(edge, "edge");
    cusp::check_finite(crease_deg, "crease_deg");
    threads = cusp::checked_threads(threads);
    if (!(edges_of(vertices, faces) / edge < kMostEdges))
        throw std::invalid_argument("the edge length is too small for the size of the mesh");
    const auto n = static_cast<int32_t>(vertices.shape(0)), m = static_cast<int32_t>(faces.shape(0));
    std::vector<double> points;
    auto* corners = new std::vector<int32_t>();
    const nb::capsule owner(corners, [](void* p) noexcept { delete static_cast<std::vector<int32_t>*>(p); });
    {
        const nb::gil_scoped_release no_gil;
        cusp::Remesher remesher(vertices.data(), n, faces.data(), m, edge, crease_deg, threads);
        remesher.run(passes);
        std::tie(points, *corners) = remesher.result();
    }
    return {cusp::rows_of_three(std::move(points)),
            Out2<int32_t>(corners->data(), {corners->size() / 3, 3}, owner)};
}

}  // namespace

void bind_remesh(nb::module_& m) {
    m.def("isotropic", &isotropic, "vertices"_a, "faces"_a, "edge"_a, "crease_deg"_a, "passes"_a,
          "threads"_a);
}
