// Items with a key >= 0, taken out bucket by bucket: buckets have one width and are not sorted.
//
// For a search that must not be in strict order this is cheaper than a heap: an item is written once and read
// once, and most are read while still in the first-level cache.
#pragma once

#include <algorithm>
#include <cstddef>
#include <limits>
#include <utility>
#include <vector>

namespace cusp {

template <class Item>
class BucketQueue {
   public:
    // width : of a bucket, > 0; affects only the order
    explicit BucketQueue(double width) : per_width_(1.0 / width), buckets_(1) {}

    // No key may be below the begin of the open bucket; by rounding it may, and then belongs to that bucket.
    void push(double key, const Item& item) {
        const size_t bucket = std::max(bucket_of(key), open_);
        if (bucket >= buckets_.size()) buckets_.resize(bucket + 1);
        std::vector<Item>& items = buckets_[bucket];
        if (items.capacity() == 0 && !spare_.empty()) {
            items.swap(spare_.back());
            spare_.pop_back();
        }
        items.push_back(item);
        ++count_;
    }

    // Takes an item of the open bucket; false if that is empty.
    bool pop(Item& item) {
        std::vector<Item>& items = buckets_[open_];
        if (items.empty()) return false;
        item = items.back();
        items.pop_back();
        --count_;
        return true;
    }

    // Opens the bucket of the next item, or of `nearest` (infinite: nothing) if that comes before; false if
    // there is neither, or only beyond `limit`.
    bool open_next(double limit, double nearest) {
        const bool is_near = nearest < std::numeric_limits<double>::infinity() && nearest <= limit;
        if (count_ == 0 && !is_near) return false;
        recycle(buckets_[open_]);
        const size_t last = bucket_of(is_near ? nearest : limit);
        if (count_ == 0) {
            open_ = std::max(open_, last);
        } else {
            while (open_ < last && (open_ >= buckets_.size() || buckets_[open_].empty())) ++open_;
        }
        if (open_ >= buckets_.size()) buckets_.resize(open_ + 1);
        return is_near || !buckets_[open_].empty();
    }

    // Whether `key` is in the open bucket, or before.
    bool is_open(double key) const { return bucket_of(key) <= open_; }

    void clear() {
        for (; count_ > 0; ++open_) {
            count_ -= buckets_[open_].size();
            buckets_[open_].clear();
            recycle(buckets_[open_]);
        }
        open_ = 0;
    }

   private:
    // The last bucket takes all longer keys. Chosen by hand, for memory; affects only the order.
    static constexpr size_t kMaxBuckets = 65'536;

    size_t bucket_of(double key) const {
        const double bucket = key * per_width_;
        return bucket < static_cast<double>(kMaxBuckets - 1) ? static_cast<size_t>(bucket) : kMaxBuckets - 1;
    }

    void recycle(std::vector<Item>& items) {
        if (items.capacity() == 0) return;
        spare_.emplace_back();
        spare_.back().swap(items);
    }

    double per_width_;
    size_t open_ = 0, count_ = 0;
    std::vector<std::vector<Item>> buckets_, spare_;
};

}  // namespace cusp
