#pragma once

#include <cstddef>
#include <memory>

#include "core/base/interruption.h"

#if !defined(__SANITIZE_THREAD__)
#include <tbb/task_arena.h>
#include <tbb/task_group.h>
#endif

namespace stellate::core {

#if defined(__SANITIZE_THREAD__)
template <typename Work>
bool WithThreads(int, Interruption& interruption, const Work& work) {
  if (interruption.raised()) return false;
  work();
  return !interruption.raised();
}
#else
// An arena of that many threads, 0: all cores, that nobody else uses meanwhile. Arenas are kept and
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

// Runs work() so that the ParallelFor in it use at most that many threads; 0: all cores. False if
// it was interrupted, at any point.
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

}  // namespace stellate::core
