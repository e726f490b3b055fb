#include "core/base/parallel.h"

#if defined(__SANITIZE_THREAD__)
#include <atomic>
#include <thread>
#else
#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>
#endif

namespace stellate::core {

// Under ThreadSanitizer plain threads do the work: Debian's oneTBB is not instrumented, so that
// every hand-over between its workers would look like a race and hide the real ones.
#if defined(__SANITIZE_THREAD__)
void ParallelRanges(std::size_t count, FunctionRef<void(std::size_t, std::size_t)> body) {
  constexpr int kThreads = 3;
  std::atomic<std::size_t> next{0};
  std::vector<std::thread> threads;
  for (int t = 0; t < kThreads; ++t)
    threads.emplace_back([&] {
      for (std::size_t i = next++; i < count; i = next++) body(i, i + 1);
    });
  for (std::thread& thread : threads) thread.join();
}
#else
void ParallelRanges(std::size_t count, FunctionRef<void(std::size_t, std::size_t)> body) {
  tbb::parallel_for(tbb::blocked_range<std::size_t>(0, count),
                    [&body](const auto& range) { body(range.begin(), range.end()); });
  ThrowIfInterrupted();
}
#endif

}  // namespace stellate::core
