#include "core/base/arenas.h"

#if !defined(__SANITIZE_THREAD__)
#include <tbb/task_arena.h>
#include <tbb/task_group.h>

#include <algorithm>
#include <memory>
#include <mutex>
#include <utility>
#include <vector>

#include "core/base/task_group.h"
#endif

namespace stellate::core {

#if defined(__SANITIZE_THREAD__)
bool WithThreads(int, Interruption& interruption, FunctionRef<void()> work) {
  if (interruption.raised()) return false;
  work();
  return !interruption.raised();
}

std::size_t ArenaCount() { return 0; }
#else
namespace {

struct Arenas {
  std::mutex mutex;
  std::size_t all = 0;
  std::vector<std::pair<int, std::unique_ptr<tbb::task_arena> > > idle;  // has capacity for all
};

// Never destroyed: a thread may still compute while the process ends.
Arenas& TheArenas() {
  static Arenas& arenas = *new Arenas;
  return arenas;
}

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

ArenaLease::ArenaLease(int threads) : threads_(threads) {
  Arenas& arenas = TheArenas();
  const std::lock_guard lock(arenas.mutex);
  const auto it = std::find_if(arenas.idle.begin(), arenas.idle.end(),
                               [threads](const auto& entry) { return entry.first == threads; });
  if (it != arenas.idle.end()) {
    arena_ = std::move(it->second);
    arenas.idle.erase(it);
    return;
  }
  arenas.idle.reserve(arenas.all + 1);
  constexpr int kAllCores = tbb::task_arena::automatic;
  arena_ = std::make_unique<tbb::task_arena>(threads > 0 ? threads : kAllCores);
  ++arenas.all;
}

ArenaLease::~ArenaLease() {
  Arenas& arenas = TheArenas();
  const std::lock_guard lock(arenas.mutex);
  arenas.idle.emplace_back(threads_, std::move(arena_));
}

}  // namespace

bool WithThreads(int threads, Interruption& interruption, FunctionRef<void()> work) {
  if (interruption.raised()) return false;
  const ArenaLease arena(threads);
  (*arena).execute([&] {
    tbb::task_group group(interruption.group().context);
    group.run_and_wait([&] {
      try {
        work();
      } catch (const Interrupted&) {
      }
    });
  });
  return !interruption.raised();
}

std::size_t ArenaCount() {
  Arenas& arenas = TheArenas();
  const std::lock_guard lock(arenas.mutex);
  return arenas.all;
}
#endif

}  // namespace stellate::core
