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
  };
  virtual Trouble trouble() const = 0;

  // No call waits any longer for what keeps the records, should that be away: it returns false.
  // Any thread.
  virtual void StopWaiting() {}
  // Another server has taken the records. Writes wait from then on, until StopWaiting, so that no
  // client hears of a failure of meshes that go on there. Any thread.
  virtual bool AreLost() const { return false; }
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
