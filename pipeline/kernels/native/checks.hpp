// Checks of the arguments of a binding, made before anything reads them: a wrong argument is an exception of
// Python, never an access outside of an array.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <stdexcept>
#include <string>

#include "bridge.hpp"

namespace cusp {

// Magnitude of coordinates, from which the squares of squares are still finite. Meshes are read up to 1e15.
inline constexpr double kMostCoordinate = 1e75;
// Rows of an array: numbers of half-edges and of coordinates (9 a triangle) fit into 32 bits.
inline constexpr size_t kMostRows = std::numeric_limits<int32_t>::max() / 9;
inline constexpr int kMostThreads = 256;

template <class T>
void check_count(T count, const char* what) {
    if (static_cast<size_t>(count) > kMostRows) throw std::invalid_argument(std::string(what) + ": too many");
}

// Every value is finite and of a magnitude below kMostCoordinate.
inline void check_finite(const double* values, size_t count, const char* what) {
    for (size_t i = 0; i < count; ++i)
        if (!(std::abs(values[i]) < kMostCoordinate))
            throw std::invalid_argument(std::string(what) + ": a value is not finite");
}

inline void check_finite(double value, const char* what) { check_finite(&value, 1, what); }

template <class Array>
void check_finite(const Array& values, const char* what) {
    check_finite(values.data(), values.size(), what);
}

// Every index is in [0, n).
template <class Array>
void check_indices(const Array& indices, int64_t n, const char* what) {
    for (size_t i = 0; i < indices.size(); ++i)
        if (indices.data()[i] < 0 || indices.data()[i] >= n)
            throw std::out_of_range(std::string(what) + " out of range");
}

// faces : (m, 3) with indices in [0, n)
inline void check_faces(const In2<int32_t>& faces, int64_t n) {
    if (faces.shape(1) != 3) throw std::invalid_argument("faces must be (m, 3)");
    check_count(faces.shape(0), "faces");
    check_indices(faces, n, "face");
}

// `count` rows of three finite numbers; throws `what` if the shape is another.
inline void check_rows(const In2<double>& rows, size_t count, const char* what) {
    if (rows.shape(1) != 3 || rows.shape(0) != count) throw std::invalid_argument(what);
    check_count(count, what);
    check_finite(rows, what);
}

// A number of threads that makes sense on any machine.
inline int checked_threads(int threads) { return std::clamp(threads, 1, kMostThreads); }

// The number of cells of a grid of three axes.
inline int64_t checked_cells(const In1<int64_t>& shape) {
    if (shape.shape(0) != 3) throw std::invalid_argument("a grid has three axes");
    double cells = 1;
    for (int axis = 0; axis < 3; ++axis) {
        if (shape.data()[axis] < 1) throw std::invalid_argument("a grid has a cell along each axis");
        cells *= static_cast<double>(shape.data()[axis]);
    }
    if (cells > static_cast<double>(kMostRows)) throw std::invalid_argument("grid: too many cells");
    return shape.data()[0] * shape.data()[1] * shape.data()[2];
}

}  // namespace cusp
