#pragma once

#include <cstdint>
#include <memory>
#include <string>

#include "core/status.h"
#include "server/storage/journal_file.h"
#include "server/storage/sqlite.h"

namespace stellate::server {

// A journal as an earlier Stellate wrote it: one table of meshes, one of the answers of their
// rounds. Its finished meshes are answers too; the server replays them once.
class EarlierJournal {
 public:
  // `version`: 4 or 5.
  EarlierJournal(std::string path, std::uint32_t version)
      : path_(std::move(path)), version_(version) {}

  // kFailedPrecondition, without changing a byte, if it is damaged.
  core::Status Open();
  // All meshes that it has. After Open.
  core::Status CopyTo(JournalFile* file);
  // Leaves the file alone, without a log.
  core::Status Close();

 private:
  core::Status CopyMesh(std::int64_t from, std::int64_t to, std::uint64_t* rounds,
                        JournalFile* file);
  core::Status CopyRound(std::int64_t mesh, std::int64_t round, std::int64_t to, bool* found,
                         JournalFile* file);

  const std::string path_;
  const std::uint32_t version_;
  std::unique_ptr<Sqlite> database_;
};

}  // namespace stellate::server
