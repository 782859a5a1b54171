// Parallel loop with progress and cancellation. The result of an item must not depend on its thread.
#pragma once

#include <atomic>
#include <chrono>
#include <condition_variable>
#include <cstdint>
#include <exception>
#include <functional>
#include <mutex>
#include <system_error>
#include <thread>
#include <vector>

namespace cusp {

// Called about 20 times per second on the calling thread with the share done in [0, 1]; false cancels the
// work.
using OnProgress = std::function<bool(double)>;

// Interval of the progress reports; chosen by hand, affects nothing else.
inline constexpr std::chrono::milliseconds kProgressInterval{50};

struct Cancelled : std::exception {
    const char* what() const noexcept override { return "cancelled"; }
};

// Call work(worker, item) for every item in [0, count). Each worker has its own thread and index, and takes
// `block` items at a time. Throws the first exception of a worker or of `on_progress`, or Cancelled.
template <class Work>
void for_each(int64_t count, int threads, const OnProgress& on_progress, Work&& work, int64_t block = 16) {
    threads = static_cast<int>(std::max<int64_t>(1, std::min<int64_t>(threads, count)));
    std::atomic<int64_t> next{0}, done{0};
    std::atomic<bool> stop{false};
    std::mutex mutex;
    std::condition_variable finished;
    std::exception_ptr failure;
    int running = 0;
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
    pool.reserve(static_cast<size_t>(threads));
    const auto count_running = [&](int change) {
        const std::lock_guard lock(mutex);
        running += change;
    };
    for (int worker = 0; worker < threads; ++worker) {
        count_running(1);
        try {
            pool.emplace_back(loop, worker);
        } catch (const std::system_error&) {  // the machine has no room for it: fewer do the work
            count_running(-1);
            break;
        }
    }
    if (pool.empty()) {
        count_running(1);
        loop(0);
    }
    bool cancelled = false;
    {
        std::unique_lock lock(mutex);
        while (!finished.wait_for(lock, kProgressInterval, [&] { return running == 0; })) {
            if (!on_progress || stop) continue;
            lock.unlock();
            try {
                if (!on_progress(static_cast<double>(done) / static_cast<double>(count)))
                    stop = cancelled = true;
            } catch (...) {
                const std::lock_guard relock(mutex);
                if (!failure) failure = std::current_exception();
                stop = true;
            }
            lock.lock();
        }
    }
    pool.clear();  // joins the threads
    if (failure) std::rethrow_exception(failure);
    if (cancelled) throw Cancelled();
}

}  // namespace cusp
