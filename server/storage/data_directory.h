#pragma once

#include <functional>
#include <memory>
#include <string>

#include "core/base/message.h"
#include "core/status.h"
#include "server/storage/journal_file.h"

namespace stellate::server {

// A directory with a journal in it, while this server alone has it.
class DataDirectory {
 public:
  // Made if it is not there. Refuses one that another server uses.
  static core::Expected<std::unique_ptr<DataDirectory>> Open(const std::string& path);
  ~DataDirectory();
  DataDirectory(const DataDirectory&) = delete;
  DataDirectory& operator=(const DataDirectory&) = delete;

  bool HasJournal() const;
  // It may be damaged.
  bool IsOfThisVersion() const;
  // As JournalFile::Open; of this version, or refused without changing a byte.
  core::Expected<std::unique_ptr<JournalFile>> OpenJournal() const;
  // As OpenJournal; where there is none begins one.
  core::Expected<std::unique_ptr<JournalFile>> TakeJournal() const;

  // Puts a new journal, filled by `fill`, in the place of the one that is there. A kill leaves
  // either.
  core::Status Install(const std::function<core::Status(JournalFile*)>& fill) const;

  const std::string& path() const { return path_; }
  std::string journal() const { return core::Message(path_, "/journal.sqlite"); }
  std::string log() const { return core::Message(path_, "/journal.sqlite-wal"); }
  std::string mark() const { return core::Message(path_, "/journal.mark"); }
  std::string reserve() const { return core::Message(path_, "/reserve"); }

 private:
  DataDirectory(std::string path, int lock) : path_(std::move(path)), lock_(lock) {}
  // Of the journal that is there; kFailedPrecondition: it is none.
  core::Expected<std::uint32_t> VersionOfJournal() const;

  const std::string path_;
  const int lock_;
};

}  // namespace stellate::server
