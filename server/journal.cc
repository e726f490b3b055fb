#include "server/journal.h"

#include <algorithm>
#include <utility>

#include "core/message.h"
#include "server/journal_format.h"
#include "server/recorded_mesh.h"

namespace stellate::server {

core::Expected<std::unique_ptr<Journal>> Journal::Open(const JournalOptions& options) {
  auto directory = DataDirectory::Open(options.directory);
  if (!directory) return tl::unexpected(std::move(directory.error()));
  auto opened = (*directory)->TakeJournal();
  if (!opened) return tl::unexpected(std::move(opened.error()));
  JournalFile& file = **opened;
  file.Limit(options.max_bytes);
  const auto stored = file.TakeMeshes();
  std::map<std::int64_t, std::uint64_t> bytes;
  for (const auto& [id, mesh] : stored) bytes[id] = file.BytesOf(id);
  std::unique_ptr<Journal> journal(
      new Journal(std::make_shared<SharedJournal>(std::move(*directory), std::move(*opened)),
                  options.owner_bytes));
  for (const auto& [id, mesh] : stored) {
    if (journal->Take(id, mesh, bytes[id])) continue;
    return core::Refuse(core::StatusCode::kFailedPrecondition,
                        core::Message("the journal in ", options.directory, " holds a mesh (", id,
                                      ") that makes no sense; it was left as it is: choose "
                                      "another --data-dir"));
  }
  journal->file_->StartThreads();
  return journal;
}

Journal::Journal(std::shared_ptr<SharedJournal> file, std::uint64_t owner_bytes)
    : file_(std::move(file)), owner_bytes_(owner_bytes) {}

// False: its records contradict each other.
bool Journal::Take(std::int64_t id, const JournalFile::StoredMesh& stored, std::uint64_t bytes) {
  SessionOptions options;
  SessionRecord record;
  const bool whole = DecodeStart(stored.start, &options, &record.create_time);
  const auto place =
      std::make_shared<RecordedMesh>(file_, owner_bytes_, id, stored, options, bytes);
  if (stored.removed) {
    place->Forget();
    return true;
  }
  record.rounds = stored.rounds;
  record.vertices = stored.vertices;
  if (!stored.end.empty()) record.end = DecodeEnd(stored.end);
  std::uint64_t parts = 0;
  if (!stored.result.empty()) record.result = DecodeResult(stored.result, &parts);
  if (!whole || record.end.has_value() == stored.end.empty() ||
      record.result.has_value() == stored.result.empty() || (record.result && !record.end)) {
    return false;
  }
  if (record.result && (stored.rounds > 0 || stored.has_answers)) place->RemoveRounds();
  if (record.end) record.rounds = std::min(record.rounds, record.end->rounds);
  options.record = std::move(record);
  options.journal = place;
  meshes_.push_back(std::move(options));
  return true;
}

Journal::~Journal() { file_->StopThreads(); }

std::shared_ptr<SessionJournal> Journal::NewMesh() {
  return std::make_shared<RecordedMesh>(file_, owner_bytes_);
}

}  // namespace stellate::server
