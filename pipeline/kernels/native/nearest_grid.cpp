// The grid that ranks candidate poses; see kernels/nearest_grid.py.
#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <vector>

#include "bridge.hpp"
#include "motion.hpp"
#include "point_tree.hpp"
#include "rows.hpp"
#include "triangle.hpp"

namespace nb = nanobind;
using namespace nb::literals;

namespace {

using cusp::check_rows;
using cusp::In1;
using cusp::In2;
using cusp::Matrices;
using cusp::Motion;
using cusp::Out1;
using cusp::Point;
using cusp::PointTree;
using cusp::row;
using cusp::to_numpy;
using cusp::Vec;

// The sample nearest to the centre of each cell, nearer than `reach`, or the number of samples; see
// kernels/nearest_grid.py. shape : cells along x, y, z; the last axis runs fastest
Out1<int64_t> nearest_of_cells(const In2<double>& samples, const In1<double>& low, double cell,
                               const In1<int64_t>& shape, double reach, int threads) {
    check_rows(samples, samples.shape(0), "samples must be (k, 3)");
    if (low.shape(0) != 3) throw std::invalid_argument("a grid has three axes");
    cusp::check_finite(low, "low");
    cusp::check_finite(cell, "cell");
    const int64_t all_cells = cusp::checked_cells(shape);
    threads = cusp::checked_threads(threads);
    const int64_t *cells = shape.data(), row_length = cells[2];
    const double* origin = low.data();
    std::vector<int64_t> nearest(all_cells);
    {
        const nb::gil_scoped_release no_gil;
        const PointTree tree(samples.data(), static_cast<int32_t>(samples.shape(0)));
        cusp::for_each(cells[0] * cells[1], threads, {}, [&](int, int64_t line) {
            int32_t guess = -1;
            const int64_t column = line / cells[1], row = line % cells[1];
            for (int64_t k = 0; k < row_length; ++k) {
                const Point centre{origin[0] + cell * (static_cast<double>(column) + 0.5),
                                   origin[1] + cell * (static_cast<double>(row) + 0.5),
                                   origin[2] + cell * (static_cast<double>(k) + 0.5)};
                const int32_t slot = tree.nearest_within(centre, guess, reach * reach);
                nearest[line * row_length + k] = slot < 0 ? tree.size() : tree.number(slot);
                if (slot >= 0) guess = slot;
            }
        });
    }
    return to_numpy(std::move(nearest));
}

// Mean squared distance (h,) of the points under each pose to the sample of their cell, truncated; see
// kernels/nearest_grid.py. nearest : the sample of each cell, the number of samples where there is none
Out1<double> grid_costs(const In1<int64_t>& nearest, const In2<double>& samples,
                        const In2<double>& sample_normals, const In1<double>& low, double cell,
                        const In1<int64_t>& shape, const Matrices& T, const In1<double>& normal_sign,
                        const In2<double>& points, const In2<double>& normals, double max_distance,
                        double min_agreement, int threads) {
    check_rows(samples, samples.shape(0), "samples must be (k, 3)");
    check_rows(sample_normals, samples.shape(0), "normals must be (k, 3), as the samples");
    check_rows(points, points.shape(0), "points must be (k, 3)");
    check_rows(normals, points.shape(0), "normals must be (k, 3), as the points");
    cusp::check_finite(T, "T");
    threads = cusp::checked_threads(threads);
    const int64_t cells = cusp::checked_cells(shape);
    if (low.shape(0) != 3 || normal_sign.shape(0) != T.shape(0) ||
        static_cast<int64_t>(nearest.shape(0)) != cells)
        throw std::invalid_argument("a grid of three axes, one sample a cell, one normal sign a pose");
    const auto poses = static_cast<int64_t>(T.shape(0)), count = static_cast<int64_t>(points.shape(0));
    const auto no_sample = static_cast<int64_t>(samples.shape(0));
    const double most = max_distance * max_distance;
    std::vector<double> cost(poses);
    {
        const nb::gil_scoped_release no_gil;
        cusp::for_each(poses, threads, {}, [&](int, int64_t pose) {
            const Motion motion = Motion::of(T.data() + 16 * pose);
            double sum = 0;
            for (int64_t i = 0; i < count; ++i) {
                const Point moved = motion(row(points, i));
                int64_t cell_number = 0;
                bool inside = true;
                for (int axis = 0; axis < 3; ++axis) {
                    const double at = std::floor((moved[axis] - low.data()[axis]) / cell);
                    inside = inside && at >= 0 && at < static_cast<double>(shape.data()[axis]);
                    cell_number = cell_number * shape.data()[axis] + (inside ? static_cast<int64_t>(at) : 0);
                }
                double squared = most;
                const int64_t sample = inside ? nearest.data()[cell_number] : no_sample;
                if (sample >= 0 && sample < no_sample) {
                    const Vec turned = cusp::rotated(motion.R, row(normals, i));
                    const Vec by = cusp::minus(moved.data(), samples.data() + 3 * sample);
                    const double* n = sample_normals.data() + 3 * sample;
                    if (normal_sign.data()[pose] * (turned[0] * n[0] + turned[1] * n[1] + turned[2] * n[2]) >
                        min_agreement)
                        squared = std::min(cusp::dot(by, by), most);
                }
                sum += squared;
            }
            cost[pose] = sum / static_cast<double>(count);
        });
    }
    return to_numpy(std::move(cost));
}

}  // namespace

void bind_nearest_grid(nb::module_& m) {
    m.def("nearest_of_cells", &nearest_of_cells, "samples"_a, "low"_a, "cell"_a, "shape"_a, "reach"_a,
          "threads"_a);
    m.def("grid_costs", &grid_costs, "nearest"_a, "samples"_a, "sample_normals"_a, "low"_a, "cell"_a,
          "shape"_a, "T"_a, "normal_sign"_a, "points"_a, "normals"_a, "max_distance"_a, "min_agreement"_a,
          "threads"_a);
}
