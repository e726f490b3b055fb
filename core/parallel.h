#pragma once

#include <algorithm>
#include <atomic>
#include <cstddef>
#include <memory>
#include <utility>
#include <vector>

#if defined(__SANITIZE_THREAD__)
#include <thread>
#else
#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>
#include <tbb/parallel_sort.h>
#include <tbb/task_arena.h>
#include <tbb/task_group.h>
#endif

namespace stellate::core {

// ParallelFor calls body(i) for each i in [0, count), in parallel and in no order. The bodies must
// not touch each other's data; then results do not depend on the number of threads.
//
// Work can be interrupted. It looks up in all that it does: before each body, at the end of each
// parallel stretch, and with LookUp in each loop on one thread that is as long as the mesh is
// large. What it leaves behind is then of no use.
//
// Under ThreadSanitizer plain threads do the work: Debian's oneTBB is not instrumented, so that
// every hand-over between its workers would look like a race and hide the real ones.

// Thrown out of work that was interrupted.
struct Interrupted {};

#if defined(__SANITIZE_THREAD__)
// Ends the work of another thread, once and for all.
class Interruption {
 public:
  void Raise() { raised_ = true; }
  bool raised() const { return raised_; }

 private:
  std::atomic<bool> raised_ = false;
};

inline bool IsInterrupted() { return false; }
inline void ThrowIfInterrupted() {}

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

template <typename Work>
bool WithThreads(int, Interruption& interruption, const Work& work) {
  work();
  return !interruption.raised();
}
#else
// Ends the work of another thread, once and for all.
class Interruption {
 public:
  void Raise() {
    raised_ = true;
    context_.cancel_group_execution();
  }
  bool raised() const { return raised_; }
  tbb::task_group_context& context() { return context_; }

 private:
  std::atomic<bool> raised_ = false;  // oneTBB forgets once a group has been waited for
  tbb::task_group_context context_{tbb::task_group_context::isolated};
};

// For tests: told of each look-up, by the thread that looks up.
inline std::atomic<void (*)()> on_look_up = nullptr;

inline bool IsInterrupted() {
  if (void (*const told)() = on_look_up.load(std::memory_order_relaxed)) told();
  return tbb::is_current_task_group_canceling();
}

// For long stretches of work on one thread.
inline void ThrowIfInterrupted() {
  if (IsInterrupted()) throw Interrupted{};
}

// oneTBB looks up before each of its tasks, which may be thousands of bodies: too many where a body
// takes long.
template <typename Index, typename Body>
void ParallelFor(Index count, const Body& body) {
  tbb::parallel_for(tbb::blocked_range<Index>(0, count), [&body](const auto& range) {
    for (Index i = range.begin(); i < range.end() && !IsInterrupted(); ++i) body(i);
  });
  ThrowIfInterrupted();
}

// `less` is a strict total order: equal items would end up in any order.
template <typename Item, typename Less>
void ParallelSort(std::vector<Item>& items, const Less& less) {
  tbb::parallel_sort(items.begin(), items.end(), less);
  ThrowIfInterrupted();
}

// An arena of so many threads, 0: all cores, that nobody else uses meanwhile. Arenas are kept and
// used again: oneTBB leaves the clean-up of one that had work to its own threads, and while these
// are busy elsewhere every arena given up stays in memory for good.
class ArenaLease {
 public:
  explicit ArenaLease(int threads);
  ~ArenaLease();
  ArenaLease(const ArenaLease&) = delete;
  ArenaLease& operator=(const ArenaLease&) = delete;

  tbb::task_arena& operator*() const { return *arena_; }

 private:
  const int threads_;
  std::unique_ptr<tbb::task_arena> arena_;
};

// Those of this process: as many as were ever in use at once.
std::size_t ArenaCount();

// Runs work() so that the ParallelFor in it use at most so many threads; 0: all cores. False if it
// was interrupted, at any point.
template <typename Work>
bool WithThreads(int threads, Interruption& interruption, const Work& work) {
  if (interruption.raised()) return false;
  const ArenaLease arena(threads);
  (*arena).execute([&] {
    tbb::task_group group(interruption.context());
    group.run_and_wait([&] {
      try {
        work();
      } catch (const Interrupted&) {
      }
    });
  });
  return !interruption.raised();
}
#endif

// A stretch of work on one thread looks up every so many steps of it.
inline void LookUp(std::size_t step) {
  if (step % 4096 == 0) ThrowIfInterrupted();
}

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

// Gathers what gather(i, &found) finds for each i in [0, count), in the order of i. Looks up once a
// chunk.
template <typename Item, typename Gather>
std::vector<Item> ParallelGather(std::size_t count, const Gather& gather) {
  std::vector<std::vector<Item>> parts(ChunkCount(count));
  ParallelChunks(count, [&](std::size_t chunk, std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) gather(i, &parts[chunk]);
  });
  return Concatenate(std::move(parts));
}

}  // namespace stellate::core
