// Orthographic picture of a coloured mesh: a z-buffer of samples, shaded by the angle to the viewer.
#include <nanobind/stl/tuple.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <limits>
#include <stdexcept>
#include <vector>

#include "bridge.hpp"
#include "checks.hpp"

namespace nb = nanobind;
using namespace nb::literals;

namespace {

using cusp::In2;
using Out3f = nb::ndarray<nb::numpy, float, nb::ndim<3>>;
using OutDepth = nb::ndarray<nb::numpy, double, nb::ndim<2>>;

constexpr int64_t kMostSamples = 33'554'432;  // of a picture; those of a report have half a million
constexpr int64_t kBand = 32;                 // rows that one work item draws; affects only the time
constexpr double kEdge = 1e-9;  // of a triangle: a sample this far outside counts as inside, so that no
                                // sample falls between two triangles that share an edge

// Samples lie at x = left + column * step and y = top - row * step.
struct Raster {
    double left, top, step;
    int64_t width, height;
};

// A triangle in the view frame: x right, y up, z towards the viewer.
struct Triangle {
    std::array<const double*, 3> corner;
    double area;  // twice, signed: seen from the viewer, counter-clockwise is positive

    Triangle(const double* vertices, const int32_t* face)
        : corner{vertices + 3 * int64_t{face[0]}, vertices + 3 * int64_t{face[1]},
                 vertices + 3 * int64_t{face[2]}} {
        area = cross(corner[0], corner[1], corner[2][0], corner[2][1]);
    }

    static double cross(const double* a, const double* b, double x, double y) {
        return (b[0] - a[0]) * (y - a[1]) - (b[1] - a[1]) * (x - a[0]);
    }

    // Barycentric weights of (x, y)
    std::array<double, 3> weights(double x, double y) const {
        return {cross(corner[1], corner[2], x, y) / area, cross(corner[2], corner[0], x, y) / area,
                cross(corner[0], corner[1], x, y) / area};
    }

    // Cosine of the angle between the triangle and the viewer, of either side
    double facing() const {
        std::array<double, 3> u, v;
        for (int k = 0; k < 3; ++k) u[k] = corner[1][k] - corner[0][k], v[k] = corner[2][k] - corner[0][k];
        const double x = u[1] * v[2] - u[2] * v[1], y = u[2] * v[0] - u[0] * v[2];
        return std::abs(area) / std::sqrt(x * x + y * y + area * area);
    }
};

int64_t clamped(double value, int64_t limit) {
    return static_cast<int64_t>(std::clamp(value, 0.0, static_cast<double>(limit)));
}

// The nearest face of each sample in rows [first, last): among equally near ones the first. -1 : none
void draw_band(const double* vertices, const int32_t* faces, int64_t count, const Raster& at, int64_t first,
               int64_t last, int32_t* face, double* depth) {
    for (int64_t f = 0; f < count; ++f) {
        const Triangle triangle(vertices, faces + 3 * f);
        if (!(std::abs(triangle.area) > 0)) continue;
        const auto& c = triangle.corner;
        const double y_low = std::min({c[0][1], c[1][1], c[2][1]}),
                     y_high = std::max({c[0][1], c[1][1], c[2][1]});
        const int64_t from = std::max(first, clamped(std::ceil((at.top - y_high) / at.step - kEdge), last));
        const int64_t to = clamped(std::floor((at.top - y_low) / at.step + kEdge) + 1, last);
        if (from >= to) continue;
        const double x_low = std::min({c[0][0], c[1][0], c[2][0]}),
                     x_high = std::max({c[0][0], c[1][0], c[2][0]});
        const int64_t begin = clamped(std::ceil((x_low - at.left) / at.step - kEdge), at.width);
        const int64_t end = clamped(std::floor((x_high - at.left) / at.step + kEdge) + 1, at.width);
        for (int64_t row = from; row < to; ++row) {
            for (int64_t column = begin; column < end; ++column) {
                const auto w = triangle.weights(at.left + static_cast<double>(column) * at.step,
                                                at.top - static_cast<double>(row) * at.step);
                if (w[0] < -kEdge || w[1] < -kEdge || w[2] < -kEdge) continue;
                const double z = w[0] * c[0][2] + w[1] * c[1][2] + w[2] * c[2][2];
                const int64_t sample = row * at.width + column;
                if (z > depth[sample]) depth[sample] = z, face[sample] = static_cast<int32_t>(f);
            }
        }
    }
}

// (h, w, 3) RGB of the samples and (h, w) their z, -inf for the background. vertices : (n, 3) in the view
// frame; colours : (n, 3)
std::tuple<Out3f, OutDepth> picture(const In2<double>& vertices, const In2<int32_t>& faces,
                                    const In2<double>& colours, double left, double top, double step,
                                    int64_t width, int64_t height, double ambient, double background,
                                    int threads) {
    cusp::check_rows(vertices, vertices.shape(0), "vertices must be (n, 3)");
    cusp::check_rows(colours, vertices.shape(0), "colours must be (n, 3), one a vertex");
    cusp::check_faces(faces, static_cast<int64_t>(vertices.shape(0)));
    for (const double each : {left, top, step}) cusp::check_finite(each, "the frame of the picture");
    if (width <= 0 || height <= 0 || !(step > 0)) throw std::invalid_argument("the picture has no samples");
    if (width > kMostSamples / height) throw std::invalid_argument("the picture is too large");
    threads = cusp::checked_threads(threads);
    const auto count = static_cast<int64_t>(faces.shape(0));
    const Raster at{left, top, step, width, height};
    const auto samples = static_cast<size_t>(width * height);
    auto* rgb = new std::vector<float>(3 * samples, static_cast<float>(background));
    const nb::capsule rgb_owner(rgb, [](void* p) noexcept { delete static_cast<std::vector<float>*>(p); });
    auto* depth = new std::vector<double>(samples, -std::numeric_limits<double>::infinity());
    const nb::capsule depth_owner(depth,
                                  [](void* p) noexcept { delete static_cast<std::vector<double>*>(p); });
    {
        const nb::gil_scoped_release no_gil;
        std::vector<int32_t> face(samples, -1);
        const int64_t bands = (height + kBand - 1) / kBand;
        const auto draw = [&](int, int64_t band) {
            const int64_t first = band * kBand, last = std::min(height, first + kBand);
            draw_band(vertices.data(), faces.data(), count, at, first, last, face.data(), depth->data());
            for (int64_t sample = first * width; sample < last * width; ++sample) {
                if (face[sample] < 0) continue;
                const int32_t* corners = faces.data() + 3 * static_cast<int64_t>(face[sample]);
                const Triangle triangle(vertices.data(), corners);
                const int64_t column = sample % width, row = sample / width;
                const auto w = triangle.weights(left + static_cast<double>(column) * step,
                                                top - static_cast<double>(row) * step);
                const double light = ambient + (1 - ambient) * triangle.facing();
                for (int k = 0; k < 3; ++k) {
                    double value = 0;
                    for (int c = 0; c < 3; ++c) value += w[c] * colours.data()[3 * corners[c] + k];
                    (*rgb)[3 * sample + k] = static_cast<float>(light * value);
                }
            }
        };
        cusp::for_each(bands, threads, {}, draw, 1);
    }
    const auto h = static_cast<size_t>(height), w = static_cast<size_t>(width);
    return {Out3f(rgb->data(), {h, w, 3}, rgb_owner), OutDepth(depth->data(), {h, w}, depth_owner)};
}

}  // namespace

void bind_raster(nb::module_& m) {
    m.def("picture", &picture, "vertices"_a, "faces"_a, "colours"_a, "left"_a, "top"_a, "step"_a, "width"_a,
          "height"_a, "ambient"_a, "background"_a, "threads"_a);
}
