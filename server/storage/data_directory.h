#pragma once

#include <functional>
#include <memory>
#include <string>

#include "core/base/message.h"
#include "core/status.h"
#include "server/storage/journal_file.h"

namespace stellate::server {

// The directory of a journal, locked for this server.
class DataDirectory {
 public:
  // Creates it if it does not exist. Refuses one that another server uses.
  static core::Expected<std::unique_ptr<DataDirectory>> Open(const std::string& path);
  ~DataDirectory();
  DataDirectory(const DataDirectory&) = delete;
  DataDirectory& operator=(const DataDirectory&) = delete;

  bool HasJournal() const;
  // It may be damaged.
  bool IsOfThisVersion() const;
  // As JournalFile::Open. Refuses another version, without changing a byte.
  core::Expected<std::unique_ptr<JournalFile>> OpenJournal() const;
  // As OpenJournal, but creates a journal if there is none.
  core::Expected<std::unique_ptr<JournalFile>> TakeJournal() const;

  // Replaces the journal by a new one, filled by `fill`. After a kill either of them is there.
  core::Status Install(const std::function<core::Status(JournalFile*)>& fill) const;

  const std::string& path() const { return path_; }
  std::string journal() const { return core::Message(path_, "/journal.sqlite"); }
  std::string log() const { return core::Message(path_, "/journal.sqlite-wal"); }
  std::string mark() const { return core::Message(path_, "/journal.mark"); }
  std::string reserve() const { return core::Message(path_, "/reserve"); }

 private:
  DataDirectory(std::string path, int lock) : path_(std::move(path)), lock_(lock) {}
  // kFailedPrecondition: the file is not a journal.
  core::Expected<std::uint32_t> VersionOfJournal() const;

  const std::string path_;
  const int lock_;
};

}  // namespace stellate::server
