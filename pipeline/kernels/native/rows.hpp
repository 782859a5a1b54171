// Arrays of Python as rows of three numbers.
#pragma once

#include "bridge.hpp"
#include "checks.hpp"
#include "motion.hpp"

namespace cusp {

inline Point row(const In2<double>& rows, int64_t i) {
    const double* p = rows.data() + 3 * i;
    return {p[0], p[1], p[2]};
}

}  // namespace cusp
