#include "server/storage/data_directory.h"

#include <fcntl.h>
#include <sys/file.h>
#include <unistd.h>

#include <cerrno>
#include <cstdio>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <system_error>

#include "core/base/message.h"

namespace stellate::server {
namespace {

using core::Message;
using core::Status;

constexpr std::string_view kDatabaseMagic("SQLite format 3\0", 16);
constexpr std::size_t kHeaderBytes = 100;
constexpr std::size_t kVersionAt = 60, kApplicationAt = 68;  // in the header, high byte first

Status Unusable(std::string message) {
  return {core::StatusCode::kFailedPrecondition, std::move(message)};
}

void SyncDirectory(const std::string& path) {
  const int folder = open(path.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC);
  if (folder < 0) return;
  fsync(folder);
  close(folder);
}

}  // namespace

core::Expected<std::unique_ptr<DataDirectory>> DataDirectory::Open(const std::string& path) {
  std::error_code error;
  if (std::filesystem::create_directories(path, error)) {
    std::filesystem::permissions(path, std::filesystem::perms::owner_all, error);
  }
  const int lock = open(Message(path, "/lock").c_str(), O_RDWR | O_CREAT | O_CLOEXEC, 0600);
  if (lock < 0) {
    return tl::unexpected(
        Unusable(Message("cannot write to --data-dir ", path, ": ", std::strerror(errno))));
  }
  std::unique_ptr<DataDirectory> directory(new DataDirectory(path, lock));
  if (flock(lock, LOCK_EX | LOCK_NB) != 0) {
    return tl::unexpected(Unusable(Message("another server uses --data-dir ", path,
                                           ": stop it, or choose another directory")));
  }
  return directory;
}

DataDirectory::~DataDirectory() { close(lock_); }

bool DataDirectory::HasJournal() const {
  return std::filesystem::exists(journal()) || std::filesystem::exists(log());
}

bool DataDirectory::IsOfThisVersion() const {
  const auto version = VersionOfJournal();
  if (version && *version == kJournalVersion) return true;
  const auto beside = JournalMark::Open(mark());
  return beside && *beside != nullptr;  // it tells the version too
}

// Read before SQLite sees the file: opening another program's would already change it, and one that
// seems to have no log would be read without it.
core::Expected<std::uint32_t> DataDirectory::VersionOfJournal() const {
  if (!std::filesystem::exists(journal())) {
    return tl::unexpected(DamagedJournal(journal(), "its log is there but the file is not"));
  }
  char header[kHeaderBytes] = {};
  std::ifstream file(journal(), std::ios::binary);
  if (!file) {
    return tl::unexpected(Unusable(Message("cannot read ", journal(), ": ", std::strerror(errno))));
  }
  file.read(header, kHeaderBytes);
  const auto number_at = [&](std::size_t at) {
    std::uint32_t number = 0;
    for (std::size_t i = 0; i < 4; ++i) {
      number = number << 8 | static_cast<unsigned char>(header[at + i]);
    }
    return number;
  };
  const std::uint32_t version = number_at(kVersionAt);
  const bool whole = file.gcount() == kHeaderBytes;
  const bool is_database = std::string_view(header, kDatabaseMagic.size()) == kDatabaseMagic;
  const bool is_ours = number_at(kApplicationAt) == kApplication;
  // The mark says that there was a journal.
  const bool was_ours = std::filesystem::exists(mark());
  if (!whole || !is_database || !is_ours) {
    if (was_ours) return tl::unexpected(DamagedJournal(journal(), "its beginning"));
    return tl::unexpected(Unusable(
        Message(journal(),
                " is no journal of a stellated, or its beginning is damaged; it was left as it "
                "is: choose another --data-dir")));
  }
  if (header[kSqliteFormatAt] != 2 || header[kSqliteFormatAt + 1] != 2) {
    return tl::unexpected(DamagedJournal(journal(), "its beginning"));
  }
  return version;
}

core::Expected<std::unique_ptr<JournalFile>> DataDirectory::OpenJournal() const {
  const auto version = VersionOfJournal();
  if (!version) return tl::unexpected(version.error());
  if (*version != kJournalVersion && IsOfThisVersion()) {
    return tl::unexpected(DamagedJournal(journal(), "its beginning"));
  }
  if (*version != kJournalVersion) {
    return tl::unexpected(
        Unusable(Message(journal(), " is a journal of version ", *version,
                         " but this server reads version ", std::to_string(kJournalVersion),
                         "; it was left as it is: run the server that wrote it, or choose another "
                         "--data-dir")));
  }
  auto beside = JournalMark::Open(mark());
  if (!beside) return tl::unexpected(DamagedJournal(journal(), beside.error().message));
  std::error_code error;
  if (*beside == nullptr && std::filesystem::file_size(log(), error) > 0 && !error) {
    // A copy of the file alone, made of a server that had stopped, has no log either.
    return tl::unexpected(DamagedJournal(journal(), "its log is there but its mark is not"));
  }
  return JournalFile::Open(journal(), std::move(*beside));
}

core::Expected<std::unique_ptr<JournalFile>> DataDirectory::TakeJournal() const {
  Status status;
  if (!HasJournal()) status = Install([](JournalFile*) { return Status::Ok(); });
  if (!status.ok()) return tl::unexpected(std::move(status));
  auto file = OpenJournal();
  if (!file) return file;
  // A copy of the file alone has no mark, and that of a server that was killed may lag.
  // Written under another name too: a server that fails here, or is killed, leaves the one that
  // was.
  const std::string draft = Message(path_, "/mark.new");
  status = JournalMark::Make(draft, (*file)->mark_state());
  if (status.ok() && std::rename(draft.c_str(), mark().c_str()) != 0) {
    status = Unusable(Message("cannot make ", mark(), ": ", std::strerror(errno)));
  }
  auto beside = JournalMark::Open(mark());
  if (status.ok() && !beside) status = std::move(beside.error());
  if (!status.ok()) return tl::unexpected(std::move(status));
  (*file)->SetMark(std::move(*beside));
  (*file)->Reserve(reserve());
  return file;
}

// Written under another name and then moved to its place whole.
Status DataDirectory::Install(const std::function<Status(JournalFile*)>& fill) const {
  const std::string draft = Message(path_, "/journal.new"),
                    draft_mark = Message(path_, "/mark.new");
  for (const char* suffix : {"", "-wal", "-shm", "-journal"})
    unlink(Message(draft, suffix).c_str());
  const int made = open(draft.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0600);
  if (made < 0) {
    return Unusable(Message("cannot write to --data-dir ", path_, ": ", std::strerror(errno)));
  }
  close(made);
  {
    auto file = JournalFile::Make(draft);
    if (!file) return std::move(file.error());
    Status status = fill(file->get());
    if (!status.ok()) return status;
    status = JournalMark::Make(draft_mark, (*file)->mark_state());
    if (!status.ok()) return status;
    if (!(*file)->Finish()) {
      return Unusable(Message("cannot write ", draft, ": ", (*file)->database().error()));
    }
  }
  if (std::rename(draft_mark.c_str(), mark().c_str()) != 0 ||
      std::rename(draft.c_str(), journal().c_str()) != 0) {
    return Unusable(Message("cannot make ", journal(), ": ", std::strerror(errno)));
  }
  // The log of what was there before. A kill just now leaves it, which the next start refuses.
  unlink(log().c_str());
  SyncDirectory(path_);
  return Status::Ok();
}

}  // namespace stellate::server
