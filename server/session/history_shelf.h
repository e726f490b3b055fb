#pragma once

#include <cstdint>
#include <memory>
#include <mutex>
#include <optional>
#include <vector>

#include "server/base/clock.h"
#include "server/history/watch_log.h"
#include "server/session/session_options.h"

namespace stellate::server {

// Is woken when a mesh has something new. On any thread; must not block.
class SessionWatcher {
 public:
  virtual ~SessionWatcher() = default;
  virtual void Wake() = 0;
};

// One mesh's history, as its watchers find it: the rounds that were published, how the mesh stood
// at each of them, and whom the next one wakes. It lies in memory while the mesh grows. Once the
// mesh has ended and its journal has the history, it is put away when it is not read, and loaded
// again for the next reader. Any thread, but Publish and Record: those are for the session's.
class HistoryShelf {
 public:
  // `options` outlive it.
  explicit HistoryShelf(const SessionOptions& options);

  // Adds what a round has changed; `now` is how the mesh stands after it. kFailedPrecondition, and
  // no change, if the round does not follow the last one.
  core::Status Publish(const core::MeshDelta& delta, const PastProgress& now);
  // Gives the journal the finished history with what became of the mesh.
  std::optional<MeshFailure> Record(const core::Progress& progress, const core::Report& report);

  // The history, which stays in memory as long as the caller holds it. Null: only the journal has
  // it.
  std::shared_ptr<const WatchLog> log() const;
  std::uint64_t revision() const;  // the newest that can be read
  // The newest revision that can be asked for: while a recorded mesh is replayed, the one at which
  // the replay will end.
  std::uint64_t PublishedRevision() const;
  // The newest revision that any watcher may have. Later than the published one where a replay has
  // failed on its way to what an earlier server had shown.
  std::uint64_t SeenRevision() const;
  // How the mesh stood at revisions after this one.
  std::vector<PastProgress> PastAfter(std::uint64_t revision) const;

  // Reads it back from the journal, if the memory budget allows, and wakes the watchers. May take a
  // while.
  enum class Loading { kDone, kNoMemory, kFailed };
  Loading Load();
  bool IsLost() const;  // Load has returned kFailed
  // Takes it from memory, if the journal has it and it was not held for `unused`. False: it stays.
  bool PutAway(Clock::duration unused);
  // Tells the memory budget what a finished mesh holds.
  void CountBytes();

  // False: there are too many.
  bool AddWatcher(std::weak_ptr<SessionWatcher> watcher);
  std::size_t watchers() const;
  void WakeWatchers();

 private:
  enum class Place { kMemory, kMemoryAndJournal, kJournal, kLost };

  const SessionOptions& options_;

  mutable std::mutex mutex_;
  Place place_ = Place::kMemory;
  std::shared_ptr<WatchLog> log_;  // where it is in memory
  std::uint64_t revision_ = 0;     // the last, where the journal has it
  std::uint64_t bytes_ = 0;        // in memory, about; where the journal has it
  TimePoint used_;                 // last known to be held
  ProgressHistory past_;
  std::vector<std::weak_ptr<SessionWatcher>> watchers_;
};

}  // namespace stellate::server
