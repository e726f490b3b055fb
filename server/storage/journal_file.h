#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "core/status.h"
#include "server/records/journal_format.h"
#include "server/storage/journal_mark.h"
#include "server/storage/sqlite.h"

namespace stellate::server {

inline constexpr std::uint32_t kApplication = 0x53744c74;  // SQLite's application_id of a journal

// A journal's file: sealed records by place, whatever their meaning. One thread at a time.
// After a call that returned false, error() and IsFull() of database() say why, and Abandon() must
// be called before the next.
class JournalFile {
 public:
  // Creates an empty one at a path where there is none.
  static core::Expected<std::unique_ptr<JournalFile>> Make(const std::string& path);
  // Opens one, with its `mark` (null: there was none). Reads every record; refuses a damaged file,
  // naming the damage, without changing a byte.
  static core::Expected<std::unique_ptr<JournalFile>> Open(const std::string& path,
                                                           std::unique_ptr<JournalMark> mark);

  // What the file had of a mesh when it was opened.
  struct StoredMesh {
    std::string start, end, result;  // as recorded; empty: none
    bool removed = false;            // marked so
    std::uint64_t rounds = 0;        // 1 to `rounds` are complete
    Standing last;                   // in the last of them
    bool has_answers = false, has_history = false;
  };
  std::map<std::int64_t, StoredMesh> TakeMeshes() { return std::move(meshes_); }

  // Runs `action`, which puts and removes records, as one transaction.
  bool Transact(const std::function<bool()>& action);
  // In a transaction.
  bool Put(const Place& place, std::string_view record);
  bool Remove(const Place& place);  // if it is there
  std::int64_t NewMesh() { return pending_.next_mesh++; }
  // Undoes a transaction that could not be completed.
  void Abandon();

  // Which records of a mesh.
  enum class Kinds { kAll, kRounds, kHistory };
  // A transaction of its own: removes a bounded number of these; sets `done` once none are left.
  // With kAll the mesh is marked as incomplete until the last one.
  bool RemoveSome(std::int64_t mesh, Kinds kinds, bool* done);
  // Returns a bounded piece of the freed space to the disk; sets `done` once nothing is left.
  bool GiveBackSome(bool* done);
  bool HasSpaceToGiveBack();
  // Moves records from the log, where they are written first, to their place.
  bool Checkpoint() { return database_->Checkpoint(); }
  bool IsLogLong() const;
  // The same for the whole log, which is then empty.
  bool Finish() { return database_->Execute("PRAGMA wal_checkpoint(TRUNCATE)"); }
  void SetMark(std::unique_ptr<JournalMark> mark) { mark_ = std::move(mark); }
  bool SyncMark() { return mark_ == nullptr || mark_->Sync(); }

  enum class Found { kYes, kNo, kDamaged };
  Found Read(const Place& place, std::string* record);

  // Bytes of all records of a mesh.
  std::uint64_t BytesOf(std::int64_t mesh) const;
  JournalMark::State mark_state() const { return {state_.identity, state_.commits}; }
  // Limits the file's size; 0: no limit but the disk's.
  void Limit(std::uint64_t max_bytes);
  // Keeps a file at this path, whose space removals may use on a full disk.
  void Reserve(const std::string& path);

  Sqlite& database() { return *database_; }

 private:
  explicit JournalFile(std::unique_ptr<Sqlite> database) : database_(std::move(database)) {}
  core::Status Verify(const std::string& path);
  core::Status VerifyRecords(const std::string& path, JournalState* found);
  bool Note(const Place& place, std::string_view record);
  bool PutState();
  template <typename Action>
  bool WithReserve(Action action);
  bool RemovePiece(std::int64_t mesh, Kinds kinds, bool* done);
  void Count(std::int64_t mesh, std::int64_t bytes);

  std::unique_ptr<JournalMark> mark_;  // null: not needed yet
  const std::unique_ptr<Sqlite> database_;
  std::string reserve_;
  JournalState state_, pending_;  // pending: of the transaction under way
  std::map<std::int64_t, StoredMesh> meshes_;
  std::map<std::int64_t, std::uint64_t> bytes_;         // by mesh
  std::map<std::int64_t, std::int64_t> pending_bytes_;  // what the transaction adds
};

// "PATH is damaged (WHAT) and was left as it is: ..."
core::Status DamagedJournal(const std::string& path, const std::string& what);

}  // namespace stellate::server
