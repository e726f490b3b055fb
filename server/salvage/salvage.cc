#include "server/salvage/salvage.h"

#include <unistd.h>

#include <algorithm>
#include <filesystem>
#include <map>
#include <set>
#include <system_error>
#include <utility>
#include <vector>

#include "core/base/message.h"
#include "server/salvage/journal_views.h"
#include "server/storage/data_directory.h"

namespace stellate::server {
namespace {

namespace fs = std::filesystem;
using core::Message;
using core::Status;

constexpr std::int64_t kFarthest = 100'000;  // rows without a readable one between them

Status CannotSalvage(std::string message) {
  return {core::StatusCode::kFailedPrecondition, std::move(message)};
}

// The places of a mesh's records.
struct Shelf {
  bool start = false, end = false, removed = false;
  std::string result;
  std::set<std::int64_t> history;
  std::map<std::int64_t, std::set<std::int64_t>> answers;  // by round
  std::map<std::int64_t, std::uint64_t> rounds;            // how many parts each has
};

// A new journal, and what goes into it.
class Salvage {
 public:
  explicit Salvage(JournalFile* file) : file_(file) {}

  // All that a view holds, and none had before.
  Status Read(const std::string& view);
  bool HasNothing() const { return taken_.empty(); }
  // Removes again what is useless without what is lost.
  Status Sort();
  std::string Findings() const { return findings_; }

 private:
  // The records behind `after`; false: an error ended it. The last one that was read.
  bool ReadRows(Sqlite* view, std::int64_t after, std::int64_t* last);
  bool Take(const Place& place, std::string_view record);
  Status SortMesh(std::int64_t mesh, const Shelf& shelf);
  std::int64_t WholeRounds(const Shelf& shelf) const;
  Status Remove(std::int64_t mesh, JournalFile::Kinds kinds);
  Status RemoveOne(const Place& place);
  Status CannotWrite() const {
    return CannotSalvage(Message("cannot write what was salvaged: ", file_->database().error(),
                                 "; nothing was changed: make room on the disk, and try again"));
  }

  JournalFile* const file_;
  std::map<std::int64_t, Shelf> meshes_;
  std::set<Place> taken_;
  std::int64_t largest_ = 0;
  bool failed_ = false;  // to write
  std::string findings_;
};

Status Salvage::Read(const std::string& path) {
  auto view = Sqlite::Open(path, false);
  if (!view) return Status::Ok();
  const bool written = file_->Transact([&] {
    std::int64_t last = 0, from = 0, misses = 0;
    while (misses < kFarthest && !failed_ && !ReadRows(view->get(), from, &last)) {
      misses = last > from ? 1 : misses + 1;
      from = std::max(last, from) + 1;  // beyond the row, or page, that cannot be read
    }
    return !failed_;
  });
  return written ? Status::Ok() : CannotWrite();
}

bool Salvage::ReadRows(Sqlite* view, std::int64_t after, std::int64_t* last) {
  Statement rows(*view,
                 "SELECT id, mesh, kind, number, part, seal, bytes FROM records WHERE id > ? "
                 "ORDER BY id");
  rows.Bind(0, after);
  while (!failed_ && rows.Next()) {
    *last = rows.Number(0);
    const Place place{rows.Number(1), static_cast<RecordKind>(rows.Number(2)), rows.Number(3),
                      rows.Number(4)};
    const std::string_view record = rows.Bytes(6);
    const bool good = SealOf(record, place) == static_cast<std::uint64_t>(rows.Number(5));
    failed_ = good && !Take(place, record);
  }
  return !rows.failed();
}

// False: it cannot be written.
bool Salvage::Take(const Place& place, std::string_view record) {
  if (!taken_.insert(place).second) return true;
  if (!file_->Put(place, record)) return false;
  largest_ = std::max(largest_, place.mesh);
  Shelf& shelf = meshes_[place.mesh];
  switch (place.kind) {
    case RecordKind::kStart:
      shelf.start = true;
      break;
    case RecordKind::kEnd:
      shelf.end = true;
      break;
    case RecordKind::kResult:
      shelf.result = record;
      break;
    case RecordKind::kRemoved:
      shelf.removed = true;
      break;
    case RecordKind::kHistoryPart:
      shelf.history.insert(place.part);
      break;
    case RecordKind::kAnswers:
      shelf.answers[place.number].insert(place.part);
      break;
    case RecordKind::kRound:
      if (const auto round = DecodeRound(record)) shelf.rounds[place.number] = round->parts;
      break;
    case RecordKind::kState:
      break;
  }
  return true;
}

Status Salvage::Sort() {
  const bool numbered = file_->Transact([&] {
    while (file_->NewMesh() <= largest_) {
    }
    return true;
  });
  if (!numbered) return CannotWrite();
  for (const auto& [mesh, shelf] : meshes_) {
    Status status = SortMesh(mesh, shelf);
    if (!status.ok()) return status;
  }
  return Status::Ok();
}

// From the first on, without a gap.
std::int64_t Salvage::WholeRounds(const Shelf& shelf) const {
  std::int64_t whole = 0;
  for (const auto& [round, parts] : shelf.rounds) {
    const auto answers = shelf.answers.find(round);
    const std::uint64_t there = answers == shelf.answers.end() ? 0 : answers->second.size();
    if (round != whole + 1 || there < parts) break;
    whole = round;
  }
  return whole;
}

Status Salvage::SortMesh(std::int64_t mesh, const Shelf& shelf) {
  std::string start, end;
  MeshRequest request;
  std::chrono::system_clock::time_point created;
  file_->Read({mesh, RecordKind::kStart}, &start);
  if (shelf.removed || !shelf.start || !DecodeStart(start, &request, &created)) {
    if (!shelf.removed) {
      findings_ += Message("lost: mesh number ", mesh, ", what it was asked to be\n");
    }
    return Remove(mesh, JournalFile::Kinds::kAll);
  }
  std::uint64_t parts = 0;
  const bool result = !shelf.result.empty() && DecodeResult(shelf.result, &parts).has_value();
  if (result && shelf.end && shelf.history.size() >= parts) {
    findings_ += Message("kept: ", request.name, ", finished\n");
    return Status::Ok();
  }
  Status status = Remove(mesh, JournalFile::Kinds::kHistory);
  if (status.ok() && !shelf.result.empty()) status = RemoveOne({mesh, RecordKind::kResult});
  const std::int64_t whole = WholeRounds(shelf);
  file_->Read({mesh, RecordKind::kEnd}, &end);
  const auto ended = shelf.end ? DecodeEnd(end) : std::nullopt;
  if (status.ok() && ended && static_cast<std::int64_t>(ended->rounds) <= whole) {
    findings_ += Message("kept: ", request.name, ", finished; it will be replayed\n");
    return status;
  }
  if (status.ok() && shelf.end) status = RemoveOne({mesh, RecordKind::kEnd});
  for (const auto& [round, unused] : shelf.rounds) {
    if (status.ok() && round > whole) status = RemoveOne({mesh, RecordKind::kRound, round});
  }
  for (const auto& [round, numbers] : shelf.answers) {
    // Of the round under way those up to the first gap are of use.
    std::int64_t next = 0;
    for (const std::int64_t part : numbers) {
      const bool kept = round <= whole || (round == whole + 1 && part == next++);
      if (status.ok() && !kept) status = RemoveOne({mesh, RecordKind::kAnswers, round, part});
    }
  }
  // Any of what a mesh leaves once it is over tells that it was.
  const bool had_finished = shelf.end || !shelf.result.empty() || !shelf.history.empty();
  const bool had_more = !shelf.rounds.empty() && shelf.rounds.rbegin()->first > whole;
  findings_ += Message("kept: ", request.name, ", to go on from round ", whole,
                       had_finished ? "; lost: that it had finished" : "",
                       had_more ? "; lost: some rounds" : "", "\n");
  return status;
}

Status Salvage::Remove(std::int64_t mesh, JournalFile::Kinds kinds) {
  for (bool done = false; !done;) {
    if (!file_->RemoveSome(mesh, kinds, &done)) return CannotWrite();
  }
  return Status::Ok();
}

Status Salvage::RemoveOne(const Place& place) {
  return file_->Transact([&] { return file_->Remove(place); }) ? Status::Ok() : CannotWrite();
}

std::string Summary(JournalFile* file) {
  std::uint64_t finished = 0, unfinished = 0;
  for (const auto& [id, mesh] : file->TakeMeshes()) {
    if (!mesh.removed) ++(mesh.end.empty() ? unfinished : finished);
  }
  return Message(finished, finished == 1 ? " finished mesh, " : " finished meshes, ", unfinished,
                 " to go on");
}

// In a directory of their own, the first that is not there. As links: a new journal takes their
// places, and not their files.
core::Expected<std::string> SetAside(const DataDirectory& directory) {
  std::string aside;
  std::error_code error;
  int number = 1;
  do {
    aside = Message(directory.path(), "/damaged-", number++);
  } while (!fs::create_directory(aside, error) && !error);
  for (const std::string& path : {directory.journal(), directory.log(), directory.mark()}) {
    if (error || !fs::exists(path)) continue;
    fs::create_hard_link(path, Message(aside, "/", fs::path(path).filename().string()), error);
  }
  if (!error) return aside;
  return tl::unexpected(CannotSalvage(Message("cannot set the damaged files aside in ", aside, ": ",
                                              error.message(), "; nothing was changed")));
}

Status ReadViews(const DataDirectory& directory, const std::string& work, Salvage* salvage) {
  const std::string blank = Message(work, "/blank"), path = Message(work, "/view");
  {
    auto made = JournalFile::Make(blank);
    if (!made) return std::move(made.error());
  }
  for (const bool new_first_page : {false, true}) {
    if (!salvage->HasNothing()) break;
    for (const auto& [with_log, good_alone] :
         {std::pair{true, false}, {true, true}, {false, true}}) {
      Status status = MakeJournalView({with_log, good_alone, new_first_page}, directory.journal(),
                                      directory.log(), blank, path);
      if (status.ok()) status = salvage->Read(path);
      if (!status.ok()) return status;
    }
  }
  return salvage->Sort();
}

}  // namespace

core::Expected<std::string> VerifyDataDir(const std::string& path) {
  auto directory = DataDirectory::Open(path);
  if (!directory) return tl::unexpected(std::move(directory.error()));
  if (!(*directory)->HasJournal()) {
    return tl::unexpected(CannotSalvage(Message("there is no journal in ", path)));
  }
  const auto journal = (*directory)->OpenJournal();
  if (!journal) return tl::unexpected(journal.error());
  (*journal)->database().CheckpointOnClose(false);
  return Message((*directory)->journal(), " is sound: ", Summary(journal->get()), "\n");
}

core::Expected<std::string> SalvageDataDir(const std::string& path) {
  auto sound = VerifyDataDir(path);
  if (sound) return *sound + "nothing was changed\n";
  auto opened = DataDirectory::Open(path);
  if (!opened) return tl::unexpected(std::move(opened.error()));
  const DataDirectory& directory = **opened;
  if (!directory.IsOfThisVersion()) return sound;  // what it is not cannot be damaged
  const auto aside = SetAside(directory);
  if (!aside) return tl::unexpected(aside.error());
  const std::string work = Message(path, "/salvage");
  std::error_code error;
  fs::remove_all(work, error);
  fs::create_directory(work, error);
  std::string findings;
  const Status status = directory.Install([&](JournalFile* file) {
    Salvage salvage(file);
    Status read = ReadViews(directory, work, &salvage);
    findings = salvage.Findings();
    return read;
  });
  fs::remove_all(work, error);
  if (!status.ok()) return tl::unexpected(status);
  return Message("damage: ", sound.error().message, "\n", findings,
                 findings.empty() ? "no mesh could be read\n" : "",
                 "a mesh that is not listed here is lost, or was deleted; one that was "
                 "deleted of late may be back\nthe damaged files are in ",
                 *aside, "\n");
}

}  // namespace stellate::server
