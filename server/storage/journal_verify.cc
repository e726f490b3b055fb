// The parts of JournalFile that make one, and that find it sound.

#include <random>

#include "core/base/message.h"
#include "server/storage/journal_file.h"

namespace stellate::server {
namespace {

using core::Message;
using core::Status;

constexpr char kRecords[] =
    "CREATE TABLE records (id INTEGER PRIMARY KEY, mesh INTEGER NOT NULL, kind INTEGER NOT NULL, "
    "number INTEGER NOT NULL, part INTEGER NOT NULL, seal INTEGER NOT NULL, bytes BLOB NOT NULL, "
    "UNIQUE (mesh, kind, number, part))";
constexpr char kState[] = "CREATE TABLE state (seal INTEGER NOT NULL, bytes BLOB NOT NULL)";

std::uint64_t NewIdentity() {
  std::random_device random;
  return std::uint64_t{random()} << 32 | random();
}

}  // namespace

Status DamagedJournal(const std::string& path, const std::string& what) {
  return {core::StatusCode::kFailedPrecondition,
          Message(path, " is damaged (", what,
                  ") and was left as it is: put back a copy of the directory, or run stellated "
                  "with --salvage, which keeps what can be read, or choose another --data-dir")};
}

core::Expected<std::unique_ptr<JournalFile>> JournalFile::Make(const std::string& path) {
  const auto fail = [&](const std::string& why) {
    return core::Refuse(core::StatusCode::kFailedPrecondition,
                        Message("cannot begin a journal at ", path, ": ", why));
  };
  auto database = Sqlite::Open(path, true);
  if (!database) return fail(database.error().message);
  std::unique_ptr<JournalFile> file(new JournalFile(std::move(*database)));
  file->state_.identity = NewIdentity();
  Sqlite& sqlite = *file->database_;
  const std::string version = Message("PRAGMA application_id=", std::to_string(kApplication),
                                      "; PRAGMA user_version=", std::to_string(kJournalVersion));
  for (const char* sql : {"PRAGMA auto_vacuum=INCREMENTAL", "PRAGMA journal_mode=WAL",
                          "PRAGMA synchronous=FULL", "PRAGMA temp_store=MEMORY"}) {
    if (!sqlite.Execute(sql)) return fail(sqlite.error());
  }
  const bool made = file->Transact([&] {
    return sqlite.Execute(kRecords) && sqlite.Execute(kState) && sqlite.Execute(version.c_str()) &&
           sqlite.Execute("INSERT INTO state VALUES (0, x'')");
  });
  if (!made) return fail(sqlite.error());
  return file;
}

core::Expected<std::unique_ptr<JournalFile>> JournalFile::Open(const std::string& path,
                                                               std::unique_ptr<JournalMark> mark) {
  auto database = Sqlite::Open(path, false);
  if (!database) return tl::unexpected(DamagedJournal(path, database.error().message));
  std::unique_ptr<JournalFile> file(new JournalFile(std::move(*database)));
  file->mark_ = std::move(mark);
  // While it is not known to be sound nothing may be moved into it from its log.
  file->database_->CheckpointOnClose(false);
  Status status = file->Verify(path);
  if (!status.ok()) return tl::unexpected(std::move(status));
  file->database_->CheckpointOnClose(true);
  return file;
}

Status JournalFile::Verify(const std::string& path) {
  for (const char* sql :
       {"PRAGMA locking_mode=EXCLUSIVE", "PRAGMA synchronous=FULL", "PRAGMA temp_store=MEMORY",
        "PRAGMA journal_size_limit=67108864",
        // What is removed is cut off the file: to write zeros over it first would only take longer.
        "PRAGMA secure_delete=FAST"}) {
    if (!database_->Execute(sql)) return DamagedJournal(path, database_->error());
  }
  std::vector<std::string> tables;
  {
    Statement schema(*database_,
                     "SELECT sql FROM sqlite_schema WHERE sql IS NOT NULL ORDER BY name");
    while (schema.Next()) tables.emplace_back(schema.Bytes(0));
    if (schema.failed()) return DamagedJournal(path, database_->error());
  }
  if (tables != std::vector<std::string>{kRecords, kState}) {
    return DamagedJournal(path, "its tables are not those of a journal");
  }
  {
    Statement rows(*database_, "SELECT seal, bytes FROM state");
    if (!rows.Next()) return DamagedJournal(path, "its state is not there");
    const auto state = DecodeState(rows.Bytes(1));
    if (!state || SealOf(rows.Bytes(1), Place{}) != static_cast<std::uint64_t>(rows.Number(0))) {
      return DamagedJournal(path, "its state");
    }
    state_ = *state;
  }
  if (mark_ != nullptr && mark_->state().identity != state_.identity) {
    return DamagedJournal(path, "the mark beside it is of another journal");
  }
  if (mark_ != nullptr && mark_->state().commits > state_.commits) {
    return DamagedJournal(
        path, Message("the last ", mark_->state().commits - state_.commits, " of ",
                      mark_->state().commits,
                      " transactions are missing: its log is damaged, or this is an older copy"));
  }
  {
    Statement check(*database_, "PRAGMA integrity_check(1)");
    if (!check.Next()) return DamagedJournal(path, database_->error());
    if (check.Bytes(0) != "ok") return DamagedJournal(path, std::string(check.Bytes(0)));
  }
  JournalState found = state_;
  found.records = found.sum = 0;
  Status status = VerifyRecords(path, &found);
  if (!status.ok()) return status;
  if (!(found == state_)) {
    return DamagedJournal(
        path, Message("it should hold ", state_.records, " records and holds ", found.records,
                      found.records == state_.records ? "; some of these are not the last "
                                                        "version written"
                                                      : ""));
  }
  return Status::Ok();
}

Status JournalFile::VerifyRecords(const std::string& path, JournalState* found) {
  Statement rows(*database_, "SELECT mesh, kind, number, part, seal, bytes FROM records");
  while (rows.Next()) {
    const Place place{rows.Number(0), static_cast<RecordKind>(rows.Number(1)), rows.Number(2),
                      rows.Number(3)};
    const std::string_view record = rows.Bytes(5);
    const auto seal = static_cast<std::uint64_t>(rows.Number(4));
    if (SealOf(record, place) != seal || !Note(place, record)) {
      return DamagedJournal(
          path, Message("a record of mesh ", place.mesh, ", of kind ",
                        static_cast<std::int64_t>(place.kind), " and number ", place.number));
    }
    ++found->records;
    found->sum += seal;
  }
  if (rows.failed()) return DamagedJournal(path, database_->error());
  return Status::Ok();
}

// False: there is no such place.
bool JournalFile::Note(const Place& place, std::string_view record) {
  StoredMesh& mesh = meshes_[place.mesh];
  mesh.bytes += record.size();
  bytes_[place.mesh] += record.size();
  return mesh.Note(place, record);
}

}  // namespace stellate::server
