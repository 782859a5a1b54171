// Conversions between Python and C++: array arguments, array results, progress callbacks.
#pragma once

#include <nanobind/nanobind.h>
#include <nanobind/ndarray.h>
#include <nanobind/stl/optional.h>

#include <optional>
#include <utility>
#include <vector>

#include "parallel.hpp"

namespace cusp {

namespace nb = nanobind;

template <class T>
using In1 = nb::ndarray<const T, nb::ndim<1>, nb::c_contig, nb::device::cpu>;
template <class T>
using In2 = nb::ndarray<const T, nb::ndim<2>, nb::c_contig, nb::device::cpu>;
template <class T>
using Out1 = nb::ndarray<nb::numpy, T, nb::ndim<1>>;
template <class T>
using Out2 = nb::ndarray<nb::numpy, T, nb::ndim<2>>;

// (t, 4, 4) homogeneous matrices, row-major
using Matrices = nb::ndarray<const double, nb::shape<-1, 4, 4>, nb::c_contig, nb::device::cpu>;
using OutMatrices = nb::ndarray<nb::numpy, double, nb::ndim<3>>;

// Move a vector to a NumPy array (n,) without a copy.
template <class T>
Out1<T> to_numpy(std::vector<T>&& values) {
    auto* owned = new std::vector<T>(std::move(values));
    const nb::capsule owner(owned, [](void* p) noexcept { delete static_cast<std::vector<T>*>(p); });
    return Out1<T>(owned->data(), {owned->size()}, owner);
}

// The same to an array (n, 3).
inline Out2<double> rows_of_three(std::vector<double>&& values) {
    auto* owned = new std::vector<double>(std::move(values));
    const nb::capsule owner(owned, [](void* p) noexcept { delete static_cast<std::vector<double>*>(p); });
    return Out2<double>(owned->data(), {owned->size() / 3, 3}, owner);
}

// The same to homogeneous matrices (n, 4, 4).
inline OutMatrices matrices(std::vector<double>&& values) {
    auto* owned = new std::vector<double>(std::move(values));
    const nb::capsule owner(owned, [](void* p) noexcept { delete static_cast<std::vector<double>*>(p); });
    return OutMatrices(owned->data(), {owned->size() / 16, 4, 4}, owner);
}

// Progress callback of Python: called with the share done in [0, 1]; returning False cancels the work.
using Progress = std::optional<nb::typed<nb::callable, nb::object(double)>>;

// Wrap a Python callback for the C++ loop. It acquires the GIL and is called on the thread that released it.
inline OnProgress progress_callback(const Progress& progress) {
    if (!progress) return {};
    return [callable = nb::callable(*progress)](double share) {
        const nb::gil_scoped_acquire gil;
        if (PyErr_CheckSignals() != 0) throw nb::python_error();
        return !callable(share).equal(nb::bool_(false));
    };
}

}  // namespace cusp
