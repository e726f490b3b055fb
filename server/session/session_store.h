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

  // Names the mesh, unless it has a name, and starts its thread. Returns the mesh that has the name
  // already, if one has. kLimitExceeded: too many meshes are running, or the system has no further
  // thread.
  Allowed<std::shared_ptr<Session>> Create(SessionOptions options);
  // From now on. Running meshes stay, also where they are more.
  void SetLimits(StoreLimits limits);
  // Before the first Create.
  void RecordIn(JournalFactory new_journal) { new_journal_ = std::move(new_journal); }
  // Restores a mesh that an earlier server recorded. REQUIRES: options.journal and options.record
  // are set; older ones come first. A mesh that ended too long ago is deleted instead. A finished
  // one is available immediately; others are replayed a few at a time, the oldest first, as the
  // memory budget allows.
  void Restore(SessionOptions options);
  std::shared_ptr<Session> Find(const std::string& name) const;  // null: none
  // Cancels and deletes a mesh; false if there is none.
  bool Delete(const std::string& name);

  // Lets go of meshes that other servers have.
  void YieldElsewhere();

  // Returns the history of a mesh. Null: it is being read back from the journal; the mesh's
  // watchers are woken when it has been read, or is lost.
  std::shared_ptr<const MeshHistory> OpenHistory(const std::shared_ptr<Session>& session) {
    return loader_.Open(session);
  }
  // Frees the memory of histories that a journal has and no client reads. False: there were none.
  bool UnloadHistories();

  struct Page {
    std::vector<std::shared_ptr<Session>> sessions;  // oldest first
    std::vector<std::uint64_t> numbers;              // of each; later ones are greater
    bool more = false;
  };
  // The meshes of one owner, or of all owners.
  Page List(std::uint64_t after, std::size_t count, const std::optional<std::string>& owner) const;
  std::vector<std::shared_ptr<Session>> All() const;  // of all owners

  std::size_t Running() const;
  std::size_t Served() const;  // running, with a worker or all that they need
  // Deletes finished meshes that were kept long enough, and those beyond an owner's number: first
  // the ones without a vertex, then the oldest, but none of these within a minute of its end. So,
  // where clients are not authenticated, one client cannot evict another's result by creating and
  // cancelling meshes. Call it every second or so.
  void Sweep(TimePoint now);
  // Suspends all meshes and waits for their threads until `deadline`. False: some still compute;
  // the process must end without them.
  // `on_suspended` is called once no mesh can fail any more by what is broken off.
  bool Stop(
      TimePoint deadline, const std::function<void()>& on_suspended = [] {});

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

  // Deleted entries whose thread has ended and which no other thread holds; destroy them unlocked.
  std::vector<Entry> TakeDeadLocked();

  const Session::MesherFactory factory_;
  JournalFactory new_journal_;
  mutable std::mutex mutex_;
  StoreLimits limits_;
  std::map<std::uint64_t, Entry> entries_;
  std::unordered_map<std::string, std::uint64_t> numbers_;
  std::vector<Entry> dying_;  // deleted; until their threads end and their watchers leave
  std::deque<std::uint64_t> unreplayed_;
  std::uint64_t next_number_ = 1;
  bool stopped_ = false;
  HistoryLoader loader_;
};

}  // namespace stellate::server
