#pragma once

#include <cstdint>
#include <memory>
#include <mutex>
#include <optional>
#include <vector>

#include "server/base/clock.h"
#include "server/history/mesh_history.h"
#include "server/session/session_options.h"

namespace stellate::server {

// Wake is called when a mesh has a new revision or has ended. On any thread; must not block.
class SessionWatcher {
 public:
  virtual ~SessionWatcher() = default;
  virtual void Wake() = 0;
};

// Keeps one mesh's history for its watchers: the published rounds, the progress at each, and the
// watchers to wake. The history is in memory while the mesh grows. Once the mesh has ended and its
// journal has the history, it is unloaded when it is not read, and loaded again for the next
// reader. Any thread, except Publish and Record: session's thread only.
//
//   history.Publish(delta, now);                               // after each round
//   if (const auto mesh = history.loaded()) mesh->Begin(...);  // a reader; null: Load() it
class HistoryShelf {
 public:
  // `options` outlive it.
  explicit HistoryShelf(const SessionOptions& options);

  // Adds the change of one round, and the progress after it. kFailedPrecondition, and no change, if
  // the round does not follow the last one.
  core::Status Publish(const core::MeshDelta& delta, const PastProgress& now,
                       const PointPlaces& places = {});
  // Finds the orientation of the last revision, as work that can be interrupted. Once, before
  // Record.
  void Orient() { loaded_->Orient(); }
  // Writes the finished history and the mesh's result to the journal.
  std::optional<MeshFailure> Record(const core::Progress& progress, const core::Report& report);

  // Returns the history, which stays in memory while the caller holds it. Null: only the journal
  // has it.
  std::shared_ptr<const MeshHistory> loaded() const;
  std::uint64_t revision() const;  // the newest that can be read
  // The newest revision that a client may request: while a recorded mesh is replayed, the one at
  // which the replay will end.
  std::uint64_t PublishedRevision() const;
  // The newest revision that a watcher may have. Later than the published one if a replay failed
  // before it reached the last revision of an earlier server; any, if that was before this server.
  std::uint64_t SeenRevision() const;
  // The progress at each revision after this one.
  std::vector<PastProgress> PastAfter(std::uint64_t revision) const;

  // Reads the history back from the journal, if the memory budget allows, and wakes the watchers.
  // Waits for the disk.
  enum class Loading { kDone, kNoMemory, kFailed };
  Loading Load();
  bool IsLost() const;  // Load has returned kFailed
  // Frees its memory if the journal has it and no caller held it for `unused`. False: it stays.
  bool Unload(Clock::duration unused);
  // Sets what a finished mesh occupies in the memory budget.
  void CountBytes();

  // Returns false if there are too many.
  bool AddWatcher(std::weak_ptr<SessionWatcher> watcher);
  std::size_t watchers() const;
  void WakeWatchers();

 private:
  enum class Place { kMemory, kMemoryAndJournal, kJournal, kLost };

  const SessionOptions& options_;

  mutable std::mutex mutex_;
  Place place_ = Place::kMemory;
  std::shared_ptr<MeshHistory> loaded_;  // null: not in memory
  std::uint64_t revision_ = 0;           // the last, where the journal has it
  std::uint64_t bytes_ = 0;              // in memory, about; where the journal has it
  TimePoint used_;                       // last known to be held
  ProgressHistory past_;
  std::vector<std::weak_ptr<SessionWatcher>> watchers_;
};

}  // namespace stellate::server
