// Python binding of copy_icp.hpp: many start poses per call, on several threads, with the GIL released.
#include <nanobind/stl/tuple.h>

#include "bridge.hpp"
#include "checks.hpp"
#include "copy_icp.hpp"

namespace nb = nanobind;
using namespace nb::literals;

namespace {

using cusp::In2;
using cusp::Matrices;
using cusp::matrices;
using cusp::Motion;
using cusp::OnProgress;
using cusp::Out1;
using cusp::Out2;
using cusp::OutMatrices;
using cusp::Progress;
using cusp::progress_callback;
using cusp::to_numpy;

class CopyIcp {
   public:
    explicit CopyIcp(const In2<double>& points)
        : icp_(checked(points), static_cast<int32_t>(points.shape(0))) {}

    // T_points_copy by the rule "library" and at convergence (t, 4, 4), the iterations of both (t,),
    // converged (t,) 0 or 1.
    std::tuple<OutMatrices, OutMatrices, Out1<int32_t>, Out1<int32_t>, Out1<uint8_t>> align(
        const Matrices& starts, int32_t library_iterations, double library_tolerance, int32_t iterations,
        int threads, const Progress& progress) const {
        cusp::check_finite(starts, "starts");
        threads = cusp::checked_threads(threads);
        const auto count = static_cast<int64_t>(starts.shape(0));
        const cusp::CopyIcp::Rules rules{library_iterations, library_tolerance, iterations};
        std::vector<double> library(16 * count), converged(16 * count);
        std::vector<int32_t> library_steps(count), steps(count);
        std::vector<uint8_t> is_converged(count);
        const OnProgress on_progress = progress_callback(progress);
        {
            const nb::gil_scoped_release no_gil;
            std::vector<cusp::CopyIcp::Scratch> scratch(threads);
            cusp::for_each(
                count, threads, on_progress,
                [&](int worker, int64_t i) {
                    const auto trajectory =
                        icp_.align(Motion::of(starts.data() + 16 * i), rules, scratch[worker]);
                    trajectory.library.write(library.data() + 16 * i);
                    trajectory.converged.write(converged.data() + 16 * i);
                    library_steps[i] = trajectory.library_iterations;
                    steps[i] = trajectory.iterations;
                    is_converged[i] = trajectory.is_converged;
                },
                1);
        }
        return {matrices(std::move(library)), matrices(std::move(converged)),
                to_numpy(std::move(library_steps)), to_numpy(std::move(steps)),
                to_numpy(std::move(is_converged))};
    }

    // RMS distance of backs[i](starts[i](points)) to the points, with true correspondences (t,).
    Out1<double> rms_error(const Matrices& starts, const Matrices& backs, int threads) const {
        if (starts.shape(0) != backs.shape(0))
            throw std::invalid_argument("starts and backs must have one length");
        std::vector<double> errors(starts.shape(0));
        {
            const nb::gil_scoped_release no_gil;
            cusp::for_each(static_cast<int64_t>(errors.size()), threads, {}, [&](int, int64_t i) {
                errors[i] =
                    icp_.rms_error(Motion::of(starts.data() + 16 * i), Motion::of(backs.data() + 16 * i));
            });
        }
        return to_numpy(std::move(errors));
    }

   private:
    static const double* checked(const In2<double>& points) {
        cusp::check_rows(points, points.shape(0), "points must be (n, 3)");
        if (points.shape(0) == 0) throw std::invalid_argument("points must be (n, 3), n >= 1");
        return points.data();
    }

    cusp::CopyIcp icp_;
};

}  // namespace

void bind_copy_icp(nb::module_& m) {
    nb::class_<CopyIcp>(m, "CopyIcp")
        .def(nb::init<const In2<double>&>(), "points"_a)
        .def("align", &CopyIcp::align, "starts"_a, "library_iterations"_a, "library_tolerance"_a,
             "iterations"_a, "threads"_a, "progress"_a = nb::none())
        .def("rms_error", &CopyIcp::rms_error, "starts"_a, "backs"_a, "threads"_a);
}
