// Many sources on many threads, with progress and cancellation; what a source finds never depends on the thread.
#pragma once

#include <atomic>
#include <chrono>
#include <condition_variable>
#include <cstdint>
#include <exception>
#include <functional>
#include <mutex>
#include <thread>
#include <vector>

namespace cusp {

// Asked on the calling thread a few times a second with the share done; false stops the work.
using Watch = std::function<bool(double)>;

struct Cancelled : std::exception {
    const char* what() const noexcept override { return "cancelled"; }
};

// Call work(worker, item) for every item in [0, count), each worker on its own thread and with its own number. A worker takes
// `block` items at a time.
template <class Work>
void for_each(int64_t count, int threads, const Watch& watch, Work&& work, int64_t block = 16) {
    threads = static_cast<int>(std::max<int64_t>(1, std::min<int64_t>(threads, count)));
    std::atomic<int64_t> next{0}, done{0};
    std::atomic<bool> stop{false};
    std::mutex mutex;
    std::condition_variable finished;
    std::exception_ptr failure;
    int running = threads;
    auto loop = [&](int worker) {
        try {
            while (!stop) {
                const int64_t first = next.fetch_add(block);
                if (first >= count) break;
                const int64_t last = std::min(count, first + block);
                for (int64_t item = first; item < last && !stop; ++item, ++done) work(worker, item);
            }
        } catch (...) {
            const std::lock_guard lock(mutex);
            if (!failure) failure = std::current_exception();
            stop = true;
        }
        const std::lock_guard lock(mutex);
        --running;
        finished.notify_all();
    };
    std::vector<std::jthread> pool;
    for (int worker = 0; worker < threads; ++worker) pool.emplace_back(loop, worker);
    bool cancelled = false;
    {
        std::unique_lock lock(mutex);
        while (!finished.wait_for(lock, std::chrono::milliseconds(50), [&] { return running == 0; })) {
            if (!watch || stop) continue;
            lock.unlock();
            try {
                if (!watch(static_cast<double>(done) / static_cast<double>(count))) stop = cancelled = true;
            } catch (...) {
                const std::lock_guard relock(mutex);
                if (!failure) failure = std::current_exception();
                stop = true;
            }
            lock.lock();
        }
    }
    pool.clear();  // joins
    if (failure) std::rethrow_exception(failure);
    if (cancelled) throw Cancelled();
}

}  // namespace cusp
