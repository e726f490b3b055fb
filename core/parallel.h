#pragma once

#include <algorithm>
#include <cstddef>

#if defined(__SANITIZE_THREAD__)
#include <atomic>
#include <thread>
#include <vector>
#else
#include <tbb/parallel_for.h>
#include <tbb/task_arena.h>
#endif

namespace stellate::core {

// Calls body(i) for each i in [0, count), in parallel and in no order. The bodies must not touch
// each other's data; then results do not depend on the number of threads.
//
// Under ThreadSanitizer plain threads do the work: Debian's oneTBB is not instrumented, so that
// every hand-over between its workers would look like a race and hide the real ones.
#if defined(__SANITIZE_THREAD__)
inline constexpr int kSanitizedThreads = 3;

template <typename Index, typename Body>
void ParallelFor(Index count, const Body& body) {
  std::atomic<Index> next{0};
  std::vector<std::thread> threads;
  for (int t = 0; t < kSanitizedThreads; ++t)
    threads.emplace_back([&] {
      for (Index i = next++; i < count; i = next++) body(i);
    });
  for (std::thread& thread : threads) thread.join();
}

template <typename Work>
void WithThreads(int, const Work& work) {
  work();
}
#else
template <typename Index, typename Body>
void ParallelFor(Index count, const Body& body) {
  tbb::parallel_for(Index{0}, count, body);
}

// Runs work() so that the ParallelFor in it use at most so many threads; 0: all cores.
template <typename Work>
void WithThreads(int threads, const Work& work) {
  tbb::task_arena arena(threads > 0 ? threads : tbb::task_arena::automatic);
  arena.execute(work);
}
#endif

// The same in chunks whose borders depend on `count` alone, so that what bodies gather by chunk is
// the same whatever the number of threads: body(chunk, begin, end).
inline constexpr std::size_t kChunk = 64;
inline std::size_t ChunkCount(std::size_t count) { return (count + kChunk - 1) / kChunk; }

template <typename Body>
void ParallelChunks(std::size_t count, const Body& body) {
  ParallelFor(ChunkCount(count), [&](std::size_t chunk) {
    body(chunk, chunk * kChunk, std::min(count, (chunk + 1) * kChunk));
  });
}

}  // namespace stellate::core
