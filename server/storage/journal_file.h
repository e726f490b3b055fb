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
#include "server/storage/journal_mark.h"
#include "server/storage/records.h"
#include "server/storage/sqlite.h"

namespace stellate::server {

inline constexpr std::uint32_t kApplication = 0x53744c74;  // SQLite's application_id of a journal

// A journal's file, in SQLite.
class JournalFile final : public Records {
 public:
  // Creates an empty one at a path where there is none.
  static core::Expected<std::unique_ptr<JournalFile>> Make(const std::string& path);
  // Opens one, with its `mark` (null: there was none). Reads every record; refuses a damaged file,
  // naming the damage, without changing a byte.
  static core::Expected<std::unique_ptr<JournalFile>> Open(const std::string& path,
                                                           std::unique_ptr<JournalMark> mark);

  std::map<std::int64_t, StoredMesh> TakeMeshes() override { return std::move(meshes_); }

  bool Transact(const std::function<bool()>& action) override;  // all or nothing
  bool Put(const Place& place, std::string_view record) override;
  bool Remove(const Place& place) override;
  std::int64_t NewMesh() override { return pending_.next_mesh++; }
  void Abandon() override;

  bool RemoveSome(std::int64_t mesh, Kinds kinds, bool* done) override;
  bool GiveBackSome(bool* done) override;
  bool HasSpaceToGiveBack() override;
  bool Checkpoint() override { return database_->Checkpoint(); }
  bool IsLogLong() const override;
  // As Checkpoint, for the whole log, which is then empty.
  bool Finish() { return database_->Execute("PRAGMA wal_checkpoint(TRUNCATE)"); }
  void SetMark(std::unique_ptr<JournalMark> mark) { mark_ = std::move(mark); }
  bool SyncMark() override { return mark_ == nullptr || mark_->Sync(); }

  Found Read(const Place& place, std::string* record) override;
  bool ListPlaces(std::int64_t mesh, std::vector<Place>* places) override;

  std::uint64_t BytesOf(std::int64_t mesh) const override;
  Trouble trouble() const override { return {database_->IsFull(), database_->error()}; }
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
