#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "core/status.h"
#include "server/sqlite.h"

namespace stellate::server {

// A journal's file: rows of sealed bytes (server/journal_format.h), whatever they mean. One thread
// at a time. After a call that returned false, error() and IsFull() of database() say why, and
// Abandon() must be called before the next.
class JournalFile {
 public:
  // As Journal::Open.
  static core::Expected<std::unique_ptr<JournalFile>> Open(const std::string& directory,
                                                           std::uint64_t max_bytes);
  ~JournalFile();

  struct StoredMesh {
    std::int64_t id = 0;
    std::string start, end;  // unsealed; no end: empty
    std::uint64_t rounds = 0;
  };
  // What was there when it was opened, by id.
  std::vector<StoredMesh> TakeMeshes() { return std::move(meshes_); }

  // Each of these is one transaction at most.
  bool AddMesh(std::string start, std::int64_t* id);
  bool AddRound(std::int64_t mesh, std::uint64_t round, std::uint64_t questions,
                std::string_view answers);
  bool SetEnd(std::int64_t mesh, std::string end);
  // Removes a bounded piece of a mesh, at least a round; sets `done` once nothing is left of it.
  // All but the last call set its end to `mark`, so that a mesh of which something is missing shows
  // it.
  bool RemoveSome(std::int64_t mesh, const std::string& mark, bool* done);
  // Gives a bounded piece of what was removed back to the disk; sets `done` once nothing is left.
  bool GiveBackSome(bool* done);
  bool HasSpaceToGiveBack();
  // Records go to a log first: moves them to their place, which no other call does.
  bool Checkpoint() { return database_->Checkpoint(); }
  bool IsLogLong() const;

  struct StoredRound {
    bool found = false;
    bool intact = true;
    std::uint64_t questions = 0;
    std::string answers;
  };
  StoredRound ReadRound(std::int64_t mesh, std::uint64_t round);

  Sqlite& database() { return *database_; }

 private:
  JournalFile() = default;
  core::Status Lock(const std::string& directory);
  void Reserve();
  template <typename Action>
  bool WithReserve(Action action);
  bool RemoveRounds(std::int64_t mesh, const std::string& mark, bool* done);
  core::Status Verify(const std::string& path);
  core::Status VerifyRounds(const std::string& path);
  bool InsertRound(std::int64_t mesh, std::uint64_t round, std::uint64_t questions,
                   std::string_view answers);

  std::string reserve_;  // path of a file whose space removals may use on a full disk
  int lock_ = -1;
  std::unique_ptr<Sqlite> database_;
  std::vector<StoredMesh> meshes_;
  std::int64_t next_id_ = 1;
};

}  // namespace stellate::server
