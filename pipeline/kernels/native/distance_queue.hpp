// Priority queue of windows and vertices by distance: a heap with four children per node.
//
// It has half the levels of a binary heap, and the children of a node share a cache line.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <vector>

namespace cusp {

class DistanceQueue {
   public:
    struct Entry {
        double key;      // distance, smallest first
        int32_t number;  // chosen by the caller
    };

    bool empty() const { return heap_.empty(); }
    double min_key() const { return heap_.front().key; }
    void clear() { heap_.clear(); }

    void push(double key, int32_t number) {
        size_t hole = heap_.size();
        heap_.push_back({key, number});
        while (hole > 0) {
            const size_t parent = (hole - 1) / 4;
            if (!(key < heap_[parent].key)) break;
            heap_[hole] = heap_[parent];
            hole = parent;
        }
        heap_[hole] = {key, number};
    }

    Entry pop() {
        const Entry top = heap_.front(), last = heap_.back();
        heap_.pop_back();
        const size_t size = heap_.size();
        for (size_t hole = 0; size > 0;) {
            const size_t first = 4 * hole + 1;
            size_t smallest = first;
            for (size_t child = first + 1; child < std::min(first + 4, size); ++child)
                if (heap_[child].key < heap_[smallest].key) smallest = child;
            if (first >= size || !(heap_[smallest].key < last.key)) {
                heap_[hole] = last;
                break;
            }
            heap_[hole] = heap_[smallest];
            hole = smallest;
        }
        return top;
    }

   private:
    std::vector<Entry> heap_;
};

}  // namespace cusp
