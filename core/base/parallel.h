#pragma once

#include <algorithm>
#include <atomic>
#include <cstddef>
#include <utility>
#include <vector>

#include "core/base/interruption.h"

#if defined(__SANITIZE_THREAD__)
#include <thread>
#else
#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>
#include <tbb/parallel_sort.h>
#endif

namespace stellate::core {

// ParallelFor calls body(i) for each i in [0, count), in parallel and in no order. The bodies must
// not touch each other's data; then results do not depend on the number of threads.
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

template <typename Item, typename Less>
void ParallelSort(std::vector<Item>& items, const Less& less) {
  std::sort(items.begin(), items.end(), less);
}
#else
// oneTBB checks for interruption before each of its tasks, which may be thousands of bodies: too
// rarely where a body takes long.
template <typename Index, typename Body>
void ParallelFor(Index count, const Body& body) {
  tbb::parallel_for(tbb::blocked_range<Index>(0, count), [&body](const auto& range) {
    const InterruptionCheck is_interrupted;
    for (Index i = range.begin(); i < range.end() && !is_interrupted(); ++i) body(i);
  });
  ThrowIfInterrupted();
}

// `less` is a strict total order: equal items would end up in any order.
template <typename Item, typename Less>
void ParallelSort(std::vector<Item>& items, const Less& less) {
  tbb::parallel_sort(items.begin(), items.end(), less);
  ThrowIfInterrupted();
}
#endif

// The same in chunks whose borders depend on `count` alone, so that what bodies gather by chunk is
// the same whatever the number of threads: body(chunk, begin, end). Large enough to share working
// memory, small enough for some dozens of threads.
inline std::size_t ChunkSize(std::size_t count) {
  return std::clamp<std::size_t>(count / 256, 1, 64);
}
inline std::size_t ChunkCount(std::size_t count) {
  const std::size_t size = ChunkSize(count);
  return (count + size - 1) / size;
}

template <typename Body>
void ParallelChunks(std::size_t count, const Body& body) {
  const std::size_t size = ChunkSize(count);
  ParallelFor(ChunkCount(count), [&](std::size_t chunk) {
    body(chunk, chunk * size, std::min(count, (chunk + 1) * size));
  });
}

// What was found in parts, one after the other.
template <typename Item>
std::vector<Item> Concatenate(std::vector<std::vector<Item>> parts) {
  std::vector<std::size_t> begins;
  begins.reserve(parts.size());
  std::size_t count = 0;
  for (const std::vector<Item>& part : parts) {
    begins.push_back(count);
    count += part.size();
  }
  std::vector<Item> all(count);
  ParallelFor(parts.size(), [&](std::size_t i) {
    std::copy(parts[i].begin(), parts[i].end(),
              all.begin() + static_cast<std::ptrdiff_t>(begins[i]));
    parts[i] = {};
  });
  return all;
}

// Gathers what gather(i, &found) finds for each i in [0, count), in the order of i. Checks for
// interruption once a chunk.
template <typename Item, typename Gather>
std::vector<Item> ParallelGather(std::size_t count, const Gather& gather) {
  std::vector<std::vector<Item>> parts(ChunkCount(count));
  ParallelChunks(count, [&](std::size_t chunk, std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) gather(i, &parts[chunk]);
  });
  return Concatenate(std::move(parts));
}

}  // namespace stellate::core
