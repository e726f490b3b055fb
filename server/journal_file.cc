#include "server/journal_file.h"

#include <fcntl.h>
#include <sys/file.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstdio>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <map>
#include <system_error>
#include <utility>

#include "core/message.h"
#include "server/journal_format.h"

namespace stellate::server {
namespace {

using core::Message;
using core::Status;

constexpr std::string_view kFileName = "/journal.sqlite";
constexpr std::string_view kDraftName = "/journal.new";
constexpr std::string_view kMagic("SQLite format 3\0", 16);
constexpr std::size_t kHeaderBytes = 100;
constexpr std::size_t kVersionAt = 60, kApplicationAt = 68;  // in the header, high byte first
constexpr std::uint32_t kApplication = 0x53744c74;
constexpr std::size_t kPartBytes = std::size_t{1} << 20;  // SQLite copies a large one several times
constexpr int kLogPages = 1000;                           // 4 MB

constexpr std::int64_t kRemovedBytes = std::int64_t{8} << 20;  // at once
constexpr int kPagesGivenBack = 512;  // at once: each may be another's, moved

constexpr off_t kReserveBytes = off_t{16} << 20;

constexpr char kMeshes[] =
    "CREATE TABLE meshes (id INTEGER PRIMARY KEY, start BLOB NOT NULL, "
    "finish BLOB)";
constexpr char kRounds[] =
    "CREATE TABLE rounds (mesh INTEGER NOT NULL REFERENCES meshes "
    "ON DELETE CASCADE, round INTEGER NOT NULL, part INTEGER NOT NULL, "
    "parts INTEGER NOT NULL, questions INTEGER NOT NULL, "
    "answers BLOB NOT NULL, PRIMARY KEY (mesh, round, part))";

Status Unusable(std::string message) {
  return {core::StatusCode::kFailedPrecondition, std::move(message)};
}

Status Damaged(const std::string& path, const std::string& what) {
  return Unusable(Message(path, " is damaged (", what,
                          ") and was left as it is: put back a copy of it, or choose another "
                          "--data-dir"));
}

std::string StartPlace(std::int64_t id) { return Message("start/", id); }
std::string EndPlace(std::int64_t id) { return Message("end/", id); }
std::string RoundPlace(std::int64_t mesh, std::int64_t round, std::int64_t part, std::int64_t parts,
                       std::uint64_t questions) {
  return Message("round/", mesh, "/", round, "/", part, "/", parts, "/", questions);
}

// Made beside its place and moved there whole, so that an interrupted start leaves no half of it.
Status MakeFile(const std::string& directory) {
  const std::string path = directory + std::string(kFileName);
  const std::string draft = directory + std::string(kDraftName);
  for (const char* suffix : {"", "-wal", "-shm", "-journal"}) unlink((draft + suffix).c_str());
  const int made = open(draft.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0600);
  if (made < 0) {
    return Unusable(Message("cannot write to --data-dir ", directory, ": ", std::strerror(errno)));
  }
  close(made);
  {
    auto database = Sqlite::Open(draft, true);
    const auto fail = [&](const std::string& why) {
      return Unusable(Message("cannot begin a journal in ", directory, ": ", why));
    };
    if (!database) return fail(database.error().message);
    const std::string finish = Message("PRAGMA application_id=", kApplication,
                                       "; PRAGMA user_version=", kJournalVersion, "; COMMIT");
    for (const char* sql : {"PRAGMA auto_vacuum=INCREMENTAL", "PRAGMA journal_mode=WAL",
                            "PRAGMA synchronous=FULL", "BEGIN", kMeshes, kRounds, finish.c_str()}) {
      if (!(*database)->Execute(sql)) return fail((*database)->error());
    }
  }
  if (std::rename(draft.c_str(), path.c_str()) != 0) {
    return Unusable(Message("cannot make ", path, ": ", std::strerror(errno)));
  }
  const int folder = open(directory.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC);
  if (folder >= 0) {
    fsync(folder);
    close(folder);
  }
  return Status::Ok();
}

// Read before SQLite sees the file: opening another program's would already change it.
Status CheckHeader(const std::string& path) {
  char header[kHeaderBytes] = {};
  std::ifstream file(path, std::ios::binary);
  if (!file) return Unusable(Message("cannot read ", path, ": ", std::strerror(errno)));
  file.read(header, kHeaderBytes);
  const auto number_at = [&](std::size_t at) {
    std::uint32_t number = 0;
    for (std::size_t i = 0; i < 4; ++i) {
      number = number << 8 | static_cast<unsigned char>(header[at + i]);
    }
    return number;
  };
  if (file.gcount() != kHeaderBytes || std::string_view(header, kMagic.size()) != kMagic ||
      number_at(kApplicationAt) != kApplication) {
    return Unusable(Message(path,
                            " is no journal of a stellated, or its beginning is damaged; it "
                            "was left as it is: choose another --data-dir"));
  }
  const std::uint32_t version = number_at(kVersionAt);
  if (version != kJournalVersion) {
    return Unusable(Message(path, " is a journal of version ", version,
                            " but this server reads version ", kJournalVersion,
                            "; it was left as it is: run the server that wrote it, or choose "
                            "another --data-dir"));
  }
  return Status::Ok();
}

}  // namespace

JournalFile::~JournalFile() {
  database_.reset();  // before another may have it
  if (lock_ >= 0) close(lock_);
}

core::Expected<std::unique_ptr<JournalFile>> JournalFile::Open(const std::string& directory,
                                                               std::uint64_t max_bytes) {
  const std::string path = directory + std::string(kFileName);
  std::unique_ptr<JournalFile> file(new JournalFile);
  Status status = file->Lock(directory);
  const bool there = std::filesystem::exists(path);
  if (status.ok() && !there && std::filesystem::exists(path + "-wal")) {
    status = Damaged(path, "its log is there but the file is not");
  } else if (status.ok() && !there) {
    status = MakeFile(directory);
  }
  if (status.ok()) status = CheckHeader(path);
  if (!status.ok()) return tl::unexpected(std::move(status));
  auto database = Sqlite::Open(path, false);
  if (!database) return tl::unexpected(Damaged(path, database.error().message));
  file->database_ = std::move(*database);
  // While it is not known to be sound nothing may be moved into it from its log.
  Sqlite& sqlite = *file->database_;
  sqlite.CheckpointOnClose(false);
  status = file->Verify(path);
  if (!status.ok()) return tl::unexpected(std::move(status));
  sqlite.CheckpointOnClose(true);
  file->reserve_ = directory + "/reserve";
  file->Reserve();
  if (max_bytes > 0) {
    Statement size(sqlite, "PRAGMA page_size");
    const std::uint64_t page = size.Next() ? static_cast<std::uint64_t>(size.Number(0)) : 4096;
    sqlite.Execute(
        Message("PRAGMA max_page_count=", std::max<std::uint64_t>(max_bytes / page, 1)).c_str());
  }
  return file;
}

Status JournalFile::Lock(const std::string& directory) {
  std::error_code error;
  if (std::filesystem::create_directories(directory, error)) {
    std::filesystem::permissions(directory, std::filesystem::perms::owner_all, error);
  }
  const std::string path = directory + "/lock";
  lock_ = open(path.c_str(), O_RDWR | O_CREAT | O_CLOEXEC, 0600);
  if (lock_ < 0) {
    return Unusable(Message("cannot write to --data-dir ", directory, ": ", std::strerror(errno)));
  }
  if (flock(lock_, LOCK_EX | LOCK_NB) != 0) {
    return Unusable(Message("another server uses --data-dir ", directory,
                            ": stop it, or choose another directory"));
  }
  return Status::Ok();
}

Status JournalFile::Verify(const std::string& path) {
  for (const char* sql :
       {"PRAGMA locking_mode=EXCLUSIVE", "PRAGMA synchronous=FULL", "PRAGMA foreign_keys=ON",
        "PRAGMA temp_store=MEMORY", "PRAGMA journal_size_limit=67108864",
        // What is removed is cut off the file: to write zeros over it first would only take longer.
        "PRAGMA secure_delete=FAST"}) {
    if (!database_->Execute(sql)) return Damaged(path, database_->error());
  }
  Statement check(*database_, "PRAGMA quick_check(1)");
  if (!check.Next()) return Damaged(path, database_->error());
  if (check.Bytes(0) != "ok") return Damaged(path, std::string(check.Bytes(0)));
  std::vector<std::string> tables;
  Statement schema(*database_, "SELECT sql FROM sqlite_schema WHERE sql IS NOT NULL ORDER BY name");
  while (schema.Next()) tables.emplace_back(schema.Bytes(0));
  if (tables != std::vector<std::string>{kMeshes, kRounds}) {
    return Damaged(path, "its tables are not those of a journal");
  }
  Statement meshes(*database_, "SELECT id, start, finish FROM meshes ORDER BY id");
  while (meshes.Next()) {
    StoredMesh mesh;
    mesh.id = meshes.Number(0);
    const auto start = Unseal(meshes.Bytes(1), StartPlace(mesh.id));
    if (!start) return Damaged(path, Message("the specification of mesh ", mesh.id));
    mesh.start = *start;
    if (!meshes.IsNull(2)) {
      const auto end = Unseal(meshes.Bytes(2), EndPlace(mesh.id));
      if (!end) return Damaged(path, Message("the end of mesh ", mesh.id));
      mesh.end = *end;
    }
    next_id_ = mesh.id + 1;
    meshes_.push_back(std::move(mesh));
  }
  if (meshes.failed()) return Damaged(path, database_->error());
  return VerifyRounds(path);
}

Status JournalFile::VerifyRounds(const std::string& path) {
  std::map<std::int64_t, StoredMesh*> by_id;
  for (StoredMesh& mesh : meshes_) by_id.emplace(mesh.id, &mesh);
  Statement rows(*database_,
                 "SELECT mesh, round, part, parts, questions, answers FROM rounds "
                 "ORDER BY mesh, round, part");
  std::int64_t last_mesh = 0, last_round = 0, part_due = 0, parts_due = 0;
  while (rows.Next()) {
    const std::int64_t mesh = rows.Number(0), round = rows.Number(1);
    const std::int64_t part = rows.Number(2), parts = rows.Number(3);
    const std::string where = Message("round ", round, " of mesh ", mesh);
    if (part_due == parts_due) {  // the next round
      part_due = 0;
      parts_due = parts;
      if (mesh != last_mesh) last_round = 0;
      last_mesh = mesh;
      ++last_round;
    }
    const auto questions = static_cast<std::uint64_t>(rows.Number(4));
    const auto owner = by_id.find(mesh);
    if (owner == by_id.end() || mesh != last_mesh || round != last_round || part != part_due ||
        parts != parts_due) {
      return Damaged(path, where + " is not the next");
    }
    if (!Unseal(rows.Bytes(5), RoundPlace(mesh, round, part, parts, questions))) {
      return Damaged(path, where);
    }
    ++part_due;
    owner->second->rounds = static_cast<std::uint64_t>(round);
  }
  if (rows.failed()) return Damaged(path, database_->error());
  if (part_due != parts_due) return Damaged(path, "its last round has an end missing");
  return Status::Ok();
}

bool JournalFile::AddMesh(std::string start, std::int64_t* id) {
  start += SealOf(start, StartPlace(next_id_));
  Statement insert(*database_, "INSERT INTO meshes (id, start) VALUES (?, ?)");
  if (!insert.Bind(0, next_id_).Bind(1, start).Run()) return false;
  *id = next_id_++;
  return true;
}

bool JournalFile::AddRound(std::int64_t mesh, std::uint64_t round, std::uint64_t questions,
                           std::string_view answers) {
  return database_->Execute("BEGIN IMMEDIATE") && InsertRound(mesh, round, questions, answers) &&
         database_->Execute("COMMIT");
}

bool JournalFile::InsertRound(std::int64_t mesh, std::uint64_t round, std::uint64_t questions,
                              std::string_view answers) {
  const auto number = static_cast<std::int64_t>(round);
  const auto parts = static_cast<std::int64_t>((answers.size() + kPartBytes - 1) / kPartBytes);
  for (std::int64_t part = 0; part < parts; ++part) {
    std::string bytes(answers.substr(static_cast<std::size_t>(part) * kPartBytes, kPartBytes));
    bytes += SealOf(bytes, RoundPlace(mesh, number, part, parts, questions));
    Statement insert(*database_,
                     "INSERT INTO rounds (mesh, round, part, parts, questions, answers) "
                     "VALUES (?, ?, ?, ?, ?, ?)");
    insert.Bind(0, mesh).Bind(1, number).Bind(2, part).Bind(3, parts);
    if (!insert.Bind(4, static_cast<std::int64_t>(questions)).Bind(5, bytes).Run()) return false;
  }
  return true;
}

bool JournalFile::SetEnd(std::int64_t mesh, std::string end) {
  end += SealOf(end, EndPlace(mesh));
  return Statement(*database_, "UPDATE meshes SET finish = ? WHERE id = ?")
      .Bind(0, end)
      .Bind(1, mesh)
      .Run();
}

// As much as the disk gives.
void JournalFile::Reserve() {
  const int reserve = open(reserve_.c_str(), O_WRONLY | O_CREAT | O_CLOEXEC, 0600);
  if (reserve < 0) return;
  if (posix_fallocate(reserve, 0, kReserveBytes) != 0) unlink(reserve_.c_str());
  close(reserve);
}

// To remove is to write first: on a full disk the log has no room for it but what was reserved.
template <typename Action>
bool JournalFile::WithReserve(Action action) {
  if (action()) return true;
  if (!database_->IsFull()) return false;
  database_->Abandon();
  unlink(reserve_.c_str());
  return action();
}

bool JournalFile::RemoveSome(std::int64_t mesh, const std::string& mark, bool* done) {
  return WithReserve([&] { return RemoveRounds(mesh, mark, done); });
}

// The last ones first: what is left has no gap.
bool JournalFile::RemoveRounds(std::int64_t mesh, const std::string& mark, bool* done) {
  std::int64_t first = 0, bytes = 0;
  {
    Statement rounds(*database_,
                     "SELECT round, sum(length(answers)) FROM rounds WHERE mesh = ? "
                     "GROUP BY round ORDER BY round DESC");
    rounds.Bind(0, mesh);
    while (bytes < kRemovedBytes && rounds.Next()) {
      first = rounds.Number(0);
      bytes += rounds.Number(1);
    }
    *done = bytes < kRemovedBytes || !rounds.Next();
    if (rounds.failed()) return false;
  }
  if (*done) {
    return Statement(*database_, "DELETE FROM meshes WHERE id = ?").Bind(0, mesh).Run();
  }
  const auto remove = [&] {
    return Statement(*database_, "DELETE FROM rounds WHERE mesh = ? AND round >= ?")
        .Bind(0, mesh)
        .Bind(1, first)
        .Run();
  };
  // The mark may take the room of what goes with it.
  return database_->Execute("BEGIN IMMEDIATE") && remove() && SetEnd(mesh, mark) &&
         database_->Execute("COMMIT");
}

bool JournalFile::GiveBackSome(bool* done) {
  const bool given = WithReserve([&] {
    *done = !HasSpaceToGiveBack();
    if (*done) return database_->Execute("PRAGMA wal_checkpoint(TRUNCATE)");
    return database_->Execute(Message("PRAGMA incremental_vacuum(", kPagesGivenBack, ")").c_str());
  });
  if (given && *done && access(reserve_.c_str(), F_OK) != 0) Reserve();
  return given;
}

bool JournalFile::HasSpaceToGiveBack() {
  Statement pages(*database_, "PRAGMA freelist_count");
  return pages.Next() && pages.Number(0) > 0;
}

bool JournalFile::IsLogLong() const { return database_->log_pages() >= kLogPages; }

JournalFile::StoredRound JournalFile::ReadRound(std::int64_t mesh, std::uint64_t round) {
  const auto number = static_cast<std::int64_t>(round);
  StoredRound stored;
  Statement rows(*database_,
                 "SELECT part, parts, questions, answers FROM rounds WHERE mesh = ? AND round = ? "
                 "ORDER BY part");
  rows.Bind(0, mesh).Bind(1, number);
  while (rows.Next()) {
    stored.found = true;
    stored.questions = static_cast<std::uint64_t>(rows.Number(2));
    const auto part = Unseal(
        rows.Bytes(3), RoundPlace(mesh, number, rows.Number(0), rows.Number(1), stored.questions));
    if (part) stored.answers += *part;
    stored.intact = stored.intact && part.has_value();
  }
  stored.intact = stored.intact && !rows.failed();
  return stored;
}

}  // namespace stellate::server
