#include "core/base/arenas.h"

#if !defined(__SANITIZE_THREAD__)
#include <algorithm>
#include <mutex>
#include <utility>
#include <vector>

namespace stellate::core {
namespace {

struct Arenas {
  std::mutex mutex;
  std::size_t all = 0;
  std::vector<std::pair<int, std::unique_ptr<tbb::task_arena>>> idle;  // has room for all
};

// Never destroyed: a thread may still compute while the process ends.
Arenas& TheArenas() {
  static Arenas& arenas = *new Arenas;
  return arenas;
}

}  // namespace

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

std::size_t ArenaCount() {
  Arenas& arenas = TheArenas();
  const std::lock_guard lock(arenas.mutex);
  return arenas.all;
}

}  // namespace stellate::core
#endif
