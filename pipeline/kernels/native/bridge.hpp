// What crosses between Python and C++: arrays in, arrays out, a callback that hears how far the work has come.
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

template <class T>
Out1<T> to_numpy(std::vector<T>&& values) {
    auto* kept = new std::vector<T>(std::move(values));
    const nb::capsule owner(kept, [](void* p) noexcept { delete static_cast<std::vector<T>*>(p); });
    return Out1<T>(kept->data(), {kept->size()}, owner);
}

// Hears the share done; answers False to stop.
using Progress = std::optional<nb::typed<nb::callable, nb::object(double)>>;

// What a Python callback is to the C++ loop: called with the GIL, from the thread that released it.
inline Watch watched(const Progress& progress) {
    if (!progress) return {};
    return [callable = nb::callable(*progress)](double share) {
        const nb::gil_scoped_acquire gil;
        if (PyErr_CheckSignals() != 0) throw nb::python_error();
        return !callable(share).equal(nb::bool_(false));
    };
}

}  // namespace cusp
