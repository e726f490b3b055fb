#pragma once

#include <algorithm>
#include <cstddef>
#include <utility>
#include <vector>

#include "core/base/function_ref.h"
#include "core/base/interruption.h"

namespace stellate::core {

// Calls body(begin, end) for ranges that make up [0, count), in parallel and in no order. Call
// ParallelFor instead where a body takes one index; ranges depend on the number of threads.
// Compiled once: one oneTBB loop for each body was a third of the core's code, and of its time to
// compile.
void ParallelRanges(std::size_t count, FunctionRef<void(std::size_t, std::size_t)> body);

// Calls body(i) for each i in [0, count), in parallel and in no order. The bodies must not touch
// each other's data; then results do not depend on the number of threads.
//
//   ParallelFor(norms.size(), [&](std::size_t i) { norms[i] = std::abs(values[i]); });
//
// It returns when all bodies have, and throws Interrupted if the run was interrupted meanwhile.
//
// oneTBB checks for interruption before each of its tasks, which may be thousands of bodies: too
// rarely if a body takes long.
template <typename Index, typename Body>
void ParallelFor(Index count, const Body& body) {
  const auto range = [&body](std::size_t begin, std::size_t end) {
    const InterruptionCheck is_interrupted;
    for (std::size_t i = begin; i < end && !is_interrupted(); ++i) body(static_cast<Index>(i));
  };
  ParallelRanges(static_cast<std::size_t>(std::max(count, Index{0})), range);
}

// The chunks of [0, count), as ParallelChunks visits them: items of each, and how many there are.
// They depend only on `count`. Chunks are large enough to share working memory, and small enough
// for some dozens of threads.
inline std::size_t ChunkSize(std::size_t count) {
  return std::clamp<std::size_t>(count / 256, 1, 64);
}
inline std::size_t ChunkCount(std::size_t count) {
  const std::size_t size = ChunkSize(count);
  return (count + size - 1) / size;
}

// Calls body(chunk, begin, end) for each chunk, in parallel. Sums and lists that are gathered by
// chunk, and then joined in the chunks' order, are the same for any number of threads.
//
//   std::vector<double> sums(ChunkCount(values.size()));
//   ParallelChunks(values.size(), [&](std::size_t chunk, std::size_t begin, std::size_t end) {
//     for (std::size_t i = begin; i < end; ++i) sums[chunk] += values[i];
//   });
template <typename Body>
void ParallelChunks(std::size_t count, const Body& body) {
  const std::size_t size = ChunkSize(count);
  ParallelFor(ChunkCount(count), [&](std::size_t chunk) {
    body(chunk, chunk * size, std::min(count, (chunk + 1) * size));
  });
}

// Joins the results of parts, one after the other, and frees each part as soon as it is copied.
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
//
//   const auto negative = ParallelGather<double>(values.size(), [&](std::size_t i, auto* found) {
//     if (values[i] < 0) found->push_back(values[i]);
//   });
template <typename Item, typename Gather>
std::vector<Item> ParallelGather(std::size_t count, const Gather& gather) {
  std::vector<std::vector<Item>> parts(ChunkCount(count));
  ParallelChunks(count, [&](std::size_t chunk, std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) gather(i, &parts[chunk]);
  });
  return Concatenate(std::move(parts));
}

}  // namespace stellate::core
