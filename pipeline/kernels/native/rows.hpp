// Arrays of Python as rows of three numbers.
#pragma once

#include <stdexcept>

#include "bridge.hpp"
#include "motion.hpp"

namespace cusp {

inline Point row(const In2<double>& rows, int64_t i) {
    const double* p = rows.data() + 3 * i;
    return {p[0], p[1], p[2]};
}

// Throws `what` unless there are `count` rows of three.
inline void check_rows(const In2<double>& rows, size_t count, const char* what) {
    if (rows.shape(1) != 3 || rows.shape(0) != count) throw std::invalid_argument(what);
}

}  // namespace cusp
