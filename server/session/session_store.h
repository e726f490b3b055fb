#pragma once

#include <cstdint>
#include <deque>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <thread>
#include <unordered_map>
#include <vector>

#include "core/status.h"
#include "server/base/refusal.h"
#include "server/session/history_loader.h"
#include "server/session/session.h"

namespace stellate::server {

// "meshes/" and 128 random bits from the operating system, in hex.
std::string NewMeshName();
// Of the form that NewMeshName gives.
bool IsMeshName(const std::string& name);

struct StoreLimits {
  std::size_t max_running = 64;
  std::size_t keep_finished = 32;  // of each owner; see Sweep
  Clock::duration keep_for = std::chrono::hours(1);
  std::size_t max_running_of_owner = 64;  // where owners have names
};

// Owns the meshes and their threads. No call but Stop waits for a mesh.
class SessionStore {
 public:
  // Where a new mesh is recorded.
  using JournalFactory = std::function<std::shared_ptr<SessionJournal>()>;

  explicit SessionStore(StoreLimits limits, Session::MesherFactory factory = core::Mesher::Create);
  ~SessionStore();

  // Names the mesh and sets it going. kLimitExceeded: too many are running, or the system gives no
  // thread for it.
  Allowed<std::shared_ptr<Session>> Create(SessionOptions options);
  // Before the first Create.
  void RecordIn(JournalFactory new_journal) { new_journal_ = std::move(new_journal); }
  // Takes up a mesh that an earlier server recorded: options.journal and options.record are set.
  // One that ended too long ago is forgotten instead. One that its journal has whole is there at
  // once; others are replayed a few at a time, the oldest first, as the memory budget allows.
  void Restore(SessionOptions options);
  std::shared_ptr<Session> Find(const std::string& name) const;  // null: none
  // Cancels and forgets; false if there is none.
  bool Delete(const std::string& name);

  // The history of a mesh. Null: it is being read back from the journal, and the mesh's watchers
  // are woken when it is there, or lost.
  std::shared_ptr<const WatchLog> OpenHistory(const std::shared_ptr<Session>& session) {
    return loader_.Open(session);
  }
  // Takes from memory what the journal has, and nobody reads. False: there was nothing.
  bool PutAwayHistories();

  struct Page {
    std::vector<std::shared_ptr<Session>> sessions;  // oldest first
    std::vector<std::uint64_t> numbers;              // of each; later ones are greater
    bool more = false;
  };
  // One owner's; of everybody without one.
  Page List(std::uint64_t after, std::size_t count, const std::optional<std::string>& owner) const;
  std::vector<std::shared_ptr<Session>> All() const;  // everyone's

  std::size_t Running() const;
  std::size_t Served() const;  // running, with a worker
  // Forgets finished meshes that were kept long enough, and what an owner has beyond his number:
  // first those without a vertex, then the oldest, but none of these within a minute of its end. So
  // whoever is told apart from nobody can not have another's result forgotten by making and
  // cancelling meshes. To be called now and then.
  void Sweep(TimePoint now);
  // Suspends all and waits for their threads until `deadline`. False: some are still computing;
  // they are left to themselves and the process must end.
  bool Stop(TimePoint deadline);

 private:
  struct Entry {
    std::uint64_t number = 0;
    std::shared_ptr<Session> session;
    std::thread thread;
    TimePoint over_since = TimePoint::max();
  };

  Entry& AddLocked(SessionOptions options, TimePoint over_since);
  void StartLocked(Entry* entry);
  // Starts replays that are due.
  void Advance();
  void AdvanceLocked();

  std::vector<std::uint64_t> OutlivedLocked(TimePoint now);

  // Deleted entries whose thread is done and which nobody else holds; to be destroyed unlocked.
  std::vector<Entry> TakeDeadLocked();

  const StoreLimits limits_;
  const Session::MesherFactory factory_;
  JournalFactory new_journal_;
  mutable std::mutex mutex_;
  std::map<std::uint64_t, Entry> entries_;
  std::unordered_map<std::string, std::uint64_t> numbers_;
  std::vector<Entry> dying_;  // deleted; until their threads end and their watchers go
  std::deque<std::uint64_t> unreplayed_;
  std::uint64_t next_number_ = 1;
  bool stopped_ = false;
  HistoryLoader loader_;
};

}  // namespace stellate::server
