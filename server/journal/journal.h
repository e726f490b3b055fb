#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "core/status.h"
#include "server/base/refusal.h"
#include "server/journal/shared_journal.h"
#include "server/session/session.h"
#include "server/session/session_journal.h"

namespace stellate::server {

struct JournalOptions {
  std::string directory;          // made if it is not there
  std::uint64_t max_bytes = 0;    // of the journal's file; 0: what the disk holds
  std::uint64_t owner_bytes = 0;  // of the records of an owner's meshes, where owners have names;
                                  // 0: no limit
};

// Half of what a journal may have: of its limit, or of what the disk has free for it and it holds.
std::uint64_t DefaultOwnerBytes(const std::string& directory, std::uint64_t max_bytes);

// The record of all meshes of a server, in one SQLite file of its data directory: for each its
// specification, the answers of each round, and its end; once it has ended, the mesh itself in the
// place of the answers. Meshes write from their own threads, one transaction a round, synced to the
// disk before the call returns.
class Journal {
 public:
  // Opens the record of an earlier server, or begins one.
  // Refuses, with kFailedPrecondition, words for people, and without changing a byte: a file that
  // is no journal, one of another version, one that is damaged anywhere (every record is read, and
  // none is missing), and one that another server has open.
  static core::Expected<std::unique_ptr<Journal>> Open(const JournalOptions& options);
  // Meshes still running keep their part of it open.
  ~Journal();

  // The meshes that were there when it was opened, oldest first: what is recorded of
  // SessionOptions, the journal among its ports.
  std::vector<SessionOptions> TakeMeshes() { return std::move(meshes_); }

  // For a new mesh.
  std::shared_ptr<SessionJournal> NewMesh();
  // Whether the record of a new mesh of `owner` has room for its first `bytes`, and what to do if
  // not. Any thread; does not wait.
  std::optional<Refused> RefuseNewMesh(const std::string& owner, std::uint64_t bytes) const;

  // Bytes of the records of an owner's meshes; the file has a twentieth or so on top.
  std::uint64_t OwnerBytes(const std::string& owner) const { return file_->OwnerBytes(owner); }

 private:
  Journal(std::shared_ptr<SharedJournal> file, JournalOptions options);
  bool Take(std::int64_t id, const JournalFile::StoredMesh& stored, std::uint64_t bytes);

  const std::shared_ptr<SharedJournal> file_;
  const JournalOptions options_;
  std::vector<SessionOptions> meshes_;
};

}  // namespace stellate::server
