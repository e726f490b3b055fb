#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <string>
#include <string_view>
#include <vector>

#include "server/records/journal_format.h"

namespace stellate::server {

// What records had of a mesh when they were opened.
struct StoredMesh {
  std::string start, end, result;  // as recorded; empty: none
  bool removed = false;            // marked so
  std::uint64_t rounds = 0;        // 1 to `rounds` are complete
  Standing last;                   // in the last of them
  bool has_answers = false, has_history = false;
  std::uint64_t bytes = 0;  // of all its records

  // Notes a record; of answers and of history its place is enough. False: there is no such place.
  bool Note(const Place& place, std::string_view record);
};

// Where a mesh is that several servers share the records of.
struct Whereabouts {
  bool exists = false;
  std::int64_t server = 0;  // that has it
  bool is_gone = false;     // that server is: none has the mesh
  std::string address;      // of that server, for others to call; empty: not known yet
};

// A server that shares the records.
struct Peer {
  std::int64_t number = 0;
  std::int64_t beat = 0;  // as this server has last seen it: counts about each second
  std::string address;    // empty: not known yet; kUnlisted
};
// The address of one that takes no calls.
inline constexpr char kUnlisted[] = "-";

// What a server of several has to do now and then has brought.
struct Tidings {
  std::map<std::int64_t, StoredMesh> meshes;          // that this server has from now on
  std::map<std::string, std::uint64_t> owners_bytes;  // of the meshes of other servers, by owner
  std::vector<std::string> troubles;                  // why a mesh could not be taken up
};

// What several servers share the records by. Any thread, unless it says the records' own.
class Sharing {
 public:
  virtual ~Sharing() = default;

  // This server's number among them, another one once it was away for too long.
  virtual std::int64_t number() const = 0;
  virtual std::int64_t beat() const = 0;        // this server's
  virtual std::vector<Peer> Peers() const = 0;  // all servers, this one too, ascending
  // Known to these servers alone.
  virtual const std::string& secret() const = 0;
  // Where others reach this server, once it listens.
  virtual void Announce(const std::string& address) = 0;
  // Whether Tend has something to do that cannot wait.
  virtual bool IsTendingDue() const = 0;
  // A mesh that is begun must not be its owner's `limit + 1`st on all servers; 0: no limit.
  virtual void LimitOwners(std::uint64_t limit) = 0;

  // The records' thread. Takes up meshes whose servers are gone: a share of them, or the one of
  // that name.
  virtual bool Tend(const std::string& name, Tidings* tidings) = 0;
  virtual bool Locate(const std::string& name, Whereabouts* found) = 0;
};

// Sealed records by place, whatever their meaning, on a disk or in a database. One thread at a
// time, except where it says so. After a call that returned false, trouble() says why, and
// Abandon() must be called before the next.
class Records {
 public:
  virtual ~Records() = default;

  // What was there when they were opened. Once.
  virtual std::map<std::int64_t, StoredMesh> TakeMeshes() = 0;

  // Runs `action`, which puts and removes records. True: all of it is on the disk. False: none of
  // it is, or some of what was put before the rest, and what is put there next replaces that.
  virtual bool Transact(const std::function<bool()>& action) = 0;
  // In a transaction.
  virtual bool Put(const Place& place, std::string_view record) = 0;
  virtual bool Remove(const Place& place) = 0;  // if it is there
  virtual std::int64_t NewMesh() = 0;
  // Undoes a transaction that could not be completed.
  virtual void Abandon() = 0;

  // Which records of a mesh.
  enum class Kinds { kAll, kRounds, kHistory };
  // A transaction of its own: removes a bounded number of these; sets `done` once none are left.
  // With kAll the mesh is marked as incomplete until the last one.
  virtual bool RemoveSome(std::int64_t mesh, Kinds kinds, bool* done) = 0;

  enum class Found { kYes, kNo, kDamaged };
  virtual Found Read(const Place& place, std::string* record) = 0;
  // The places of all records of a mesh, ascending.
  virtual bool ListPlaces(std::int64_t mesh, std::vector<Place>* places) = 0;

  // Bytes of all records of a mesh.
  virtual std::uint64_t BytesOf(std::int64_t mesh) const = 0;

  struct Trouble {
    bool full = false;    // no room, as opposed to a fault
    std::string message;  // what went wrong
    enum class Refusal {
      kNone,
      kTooMany,  // the mesh's owner has as many as the servers allow together
      kTaken,    // another mesh has the name
    } refusal = Refusal::kNone;
  };
  virtual Trouble trouble() const = 0;

  // No call waits any longer for what keeps the records, should that be away: it returns false.
  // Any thread.
  virtual void StopWaiting() {}
  // How often the mesh has changed hands, as this server has it; another number, or 0: it is not
  // this server's any more, and nothing is written of it. Any thread.
  virtual std::int64_t EpochOf(std::int64_t /*mesh*/) const { return 1; }
  // Null: one server has them. Lives as long as this.
  virtual Sharing* sharing() { return nullptr; }
  // What keeps them does not answer. Any thread.
  virtual bool AreAway() const { return false; }

  // What a file needs now and then, and a database sees to by itself.
  virtual bool HasSpaceToGiveBack() { return false; }
  // Returns a bounded piece of the freed space to the disk; sets `done` once nothing is left.
  virtual bool GiveBackSome(bool* done) { return *done = true; }
  virtual bool IsLogLong() const { return false; }
  // Moves records from the log, where they are written first, to their place.
  virtual bool Checkpoint() { return true; }
  virtual bool SyncMark() { return true; }
};

// The kinds of records that Kinds names: from `first` to `last`.
struct KindRange {
  RecordKind first, last;
};
KindRange RangeOf(Records::Kinds kinds);

}  // namespace stellate::server
