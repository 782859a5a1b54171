// Result of many searches as columns: the (vertex, distance) pairs of each source, one after another.
#pragma once

#include <cstdint>
#include <tuple>
#include <vector>

#include "bridge.hpp"

namespace cusp {

struct Pair {
    int32_t vertex;
    double distance;
};

// (counts per source, vertices, distances)
using PairColumns = std::tuple<Out1<int64_t>, Out1<int32_t>, Out1<double>>;

// Concatenate the rows of pairs into columns; releases the rows one by one.
inline PairColumns to_columns(std::vector<std::vector<Pair>>&& rows) {
    std::vector<int64_t> counts;
    std::vector<int32_t> vertices;
    std::vector<double> distances;
    for (auto& row : rows) {
        counts.push_back(static_cast<int64_t>(row.size()));
        for (const Pair& pair : row) {
            vertices.push_back(pair.vertex);
            distances.push_back(pair.distance);
        }
        std::vector<Pair>().swap(row);
    }
    return {to_numpy(std::move(counts)), to_numpy(std::move(vertices)), to_numpy(std::move(distances))};
}

}  // namespace cusp
