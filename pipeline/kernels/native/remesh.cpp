// Python binding of the isotropic remeshing.
#include <nanobind/stl/tuple.h>

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

// vertices (n', 3) and faces (m', 3) of the same surface with edges of about `edge`
std::tuple<Out2<double>, Out2<int32_t>> isotropic(const In2<double>& vertices, const In2<int32_t>& faces,
                                                  double edge, double crease_deg, int passes, int threads) {
    cusp::check_rows(vertices, vertices.shape(0), "vertices must be (n, 3)");
    if (faces.shape(1) != 3 || faces.shape(0) == 0)
        throw std::invalid_argument("faces must be (m, 3), m > 0");
    if (!(edge > 0)) throw std::invalid_argument("the edge length must be positive");
    const auto n = static_cast<int32_t>(vertices.shape(0)), m = static_cast<int32_t>(faces.shape(0));
    for (int64_t k = 0; k < 3 * static_cast<int64_t>(m); ++k)
        if (faces.data()[k] < 0 || faces.data()[k] >= n) throw std::out_of_range("face out of range");
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
