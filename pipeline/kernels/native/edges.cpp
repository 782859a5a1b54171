// Python binding of the edges of a triangle mesh.
#include <nanobind/stl/tuple.h>

#include <algorithm>
#include <tuple>
#include <utility>
#include <vector>

#include "bridge.hpp"
#include "checks.hpp"

namespace nb = nanobind;
using namespace nb::literals;

namespace {

using cusp::In2;
using cusp::Out1;
using cusp::Out2;

struct Found {
    std::vector<int64_t> ends, of_face, count;
};

// The edges in order of their ends: sorted into buckets by the lower end, then each bucket by the upper.
Found edges_of(const int32_t* faces, size_t m, size_t n) {
    struct Side {
        int32_t high, slot;  // slot : 3 * face + the corner opposite the side
        bool operator<(const Side& other) const {
            return high != other.high ? high < other.high : slot < other.slot;
        }
    };
    const auto ends_of = [&](size_t slot) {
        const size_t face = slot / 3 * 3, corner = slot % 3;
        return std::minmax(faces[face + (corner + 1) % 3], faces[face + (corner + 2) % 3]);
    };
    std::vector<int32_t> start(n + 1, 0);
    for (size_t slot = 0; slot < 3 * m; ++slot) ++start[static_cast<size_t>(ends_of(slot).first) + 1];
    for (size_t v = 0; v < n; ++v) start[v + 1] += start[v];
    std::vector<Side> sides(3 * m);
    {
        std::vector<int32_t> next(start.begin(), start.end() - 1);
        for (size_t slot = 0; slot < 3 * m; ++slot) {
            const auto [low, high] = ends_of(slot);
            sides[static_cast<size_t>(next[static_cast<size_t>(low)]++)] = {high, static_cast<int32_t>(slot)};
        }
    }
    Found found;
    found.of_face.resize(3 * m);
    found.ends.reserve(3 * m + 2 * n);
    found.count.reserve(3 * m / 2 + n);
    for (size_t low = 0; low < n; ++low) {
        const auto first = sides.begin() + start[low], last = sides.begin() + start[low + 1];
        std::sort(first, last);
        for (auto side = first; side != last; ++side) {
            if (side == first || side->high != (side - 1)->high) {
                found.ends.push_back(static_cast<int64_t>(low));
                found.ends.push_back(side->high);
                found.count.push_back(0);
            }
            ++found.count.back();
            found.of_face[static_cast<size_t>(side->slot)] = static_cast<int64_t>(found.count.size()) - 1;
        }
    }
    found.ends.shrink_to_fit();
    found.count.shrink_to_fit();
    return found;
}

template <size_t Columns>
Out2<int64_t> rows_of(std::vector<int64_t>&& values) {
    auto* owned = new std::vector<int64_t>(std::move(values));
    const nb::capsule owner(owned, [](void* p) noexcept { delete static_cast<std::vector<int64_t>*>(p); });
    return Out2<int64_t>(owned->data(), {owned->size() / Columns, Columns}, owner);
}

// ends (k, 2) in ascending order, of_face (m, 3) the edge opposite each corner, count (k,) of triangles
std::tuple<Out2<int64_t>, Out2<int64_t>, Out1<int64_t>> edges(const In2<int32_t>& faces, int64_t n) {
    if (n < 0) throw std::invalid_argument("n must not be negative");
    cusp::check_count(n, "vertices");
    cusp::check_faces(faces, n);
    Found found;
    {
        const nb::gil_scoped_release no_gil;
        found = edges_of(faces.data(), faces.shape(0), static_cast<size_t>(n));
    }
    return {rows_of<2>(std::move(found.ends)), rows_of<3>(std::move(found.of_face)),
            cusp::to_numpy(std::move(found.count))};
}

}  // namespace

void bind_edges(nb::module_& m) { m.def("edges", &edges, "faces"_a, "n"_a); }
