#include "server/journal/journal.h"

#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <filesystem>
#include <system_error>
#include <utility>

#include "core/base/message.h"
#include "server/base/log.h"
#include "server/journal/recorded_mesh.h"
#include "server/records/journal_format.h"

namespace stellate::server {
namespace {

using core::Message;

constexpr std::uint64_t kOverhead = 16;  // a part of the file's size: what holds records together
constexpr std::uint64_t kEmptyFile = std::uint64_t{1} << 16;

}  // namespace

std::uint64_t DefaultOwnerBytes(const std::string& directory, std::uint64_t max_bytes) {
  if (max_bytes > 0) return max_bytes / 2;
  namespace fs = std::filesystem;
  std::error_code error;
  std::uint64_t bytes = 0;
  for (fs::path path = fs::absolute(directory); bytes == 0 && path.has_relative_path();
       path = path.parent_path()) {  // it may still have to be made
    const fs::space_info disk = fs::space(path, error);
    if (!error) bytes = disk.available;
  }
  for (const fs::directory_entry& file : fs::directory_iterator(directory, error)) {
    const std::uintmax_t size = file.is_regular_file(error) ? file.file_size(error) : 0;
    if (!error) bytes += size;
  }
  return bytes / 2;
}

core::Expected<std::unique_ptr<Journal>> Journal::Open(const JournalOptions& options) {
  auto directory = DataDirectory::Open(options.directory);
  if (!directory) return tl::unexpected(std::move(directory.error()));
  auto opened = (*directory)->TakeJournal();
  if (!opened) return tl::unexpected(std::move(opened.error()));
  (*opened)->Limit(options.max_bytes);
  return Begin(std::move(*directory), std::move(*opened), options);
}

core::Expected<std::unique_ptr<Journal>> Journal::Over(std::unique_ptr<Records> records,
                                                       const JournalOptions& options) {
  return Begin(nullptr, std::move(records), options);
}

core::Expected<std::unique_ptr<Journal>> Journal::Begin(std::unique_ptr<DataDirectory> directory,
                                                        std::unique_ptr<Records> records,
                                                        const JournalOptions& options) {
  const std::string where = directory == nullptr ? "the database" : directory->path();
  const auto stored = records->TakeMeshes();
  std::unique_ptr<Journal> journal(new Journal(
      std::make_shared<SharedJournal>(std::move(directory), std::move(records)), options));
  for (const auto& [id, mesh] : stored) {
    if (journal->Take(id, mesh)) continue;
    return core::Refuse(core::StatusCode::kFailedPrecondition,
                        core::Message("the journal in ", where, " holds a mesh (", id,
                                      ") that makes no sense; it was left as it is: choose "
                                      "another one"));
  }
  journal->shared_->StartThreads();
  return journal;
}

Journal::Journal(std::shared_ptr<SharedJournal> shared, JournalOptions options)
    : shared_(std::move(shared)), options_(std::move(options)) {}

std::optional<Refused> Journal::RefuseNewMesh(const std::string& owner, std::uint64_t bytes) const {
  const auto refuse = [](const char* setting, std::uint64_t limit, const char* scope,
                         const std::string& held) {
    return Refused({setting, Message(limit), scope},
                   Message(held, ", and there is no room for another mesh: delete meshes that are ",
                           "no longer needed, or raise --", setting));
  };
  if (options_.owner_bytes > 0 && !owner.empty() &&
      shared_->OwnerBytes(owner) + bytes > options_.owner_bytes) {
    return refuse(
        "owner-journal-bytes", options_.owner_bytes, "owner",
        Message("the records of your meshes have ", shared_->OwnerBytes(owner), " bytes of the ",
                options_.owner_bytes, " that the server allows each owner"));
  }
  const std::uint64_t total = shared_->TotalBytes();
  const std::uint64_t size = total + total / kOverhead + kEmptyFile;
  if (options_.max_bytes > 0 && size + bytes > options_.max_bytes) {
    return refuse("max-journal-bytes", options_.max_bytes, "server",
                  Message("the server's record has about ", size, " bytes of the ",
                          options_.max_bytes, " that it may have"));
  }
  if (options_.directory.empty()) return std::nullopt;
  std::error_code error;
  const std::filesystem::space_info disk = std::filesystem::space(options_.directory, error);
  if (error || disk.available >= bytes) return std::nullopt;
  return Refused({core::StatusCode::kLimitExceeded,
                  Message("the disk of the server's record has room for only ", disk.available,
                          " more bytes: delete meshes that are no longer needed")});
}

std::string Journal::WhyNoNewMeshes() const {
  if (IsAway()) return "the database does not answer";
  const std::string& directory = options_.directory;
  if (!directory.empty() && access(directory.c_str(), W_OK | X_OK) != 0) {
    return Message("the directory of the record cannot be written to: ", std::strerror(errno));
  }
  const auto refused = RefuseNewMesh("", kFirstRecordBytes);
  return refused ? refused->message : "";
}

// False: its records contradict each other.
bool Journal::Take(std::int64_t id, const StoredMesh& stored) {
  SessionOptions options;
  SessionRecord record;
  const bool whole = DecodeStart(stored.start, &options.request, &record.create_time);
  const auto place =
      std::make_shared<RecordedMesh>(shared_, options_.owner_bytes, id, stored, options.request);
  if (stored.removed) {
    place->Forget();
    return true;
  }
  record.rounds = stored.rounds;
  record.last = stored.last;
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
  options.ports.journal = place;
  meshes_.push_back(std::move(options));
  return true;
}

std::vector<SessionOptions> Journal::Tend(const std::string& name) {
  Tidings tidings;
  const auto failure =
      shared_->Do("that it takes up meshes", FairMutex::Place::kFirst,
                  [&](Records*) { return shared_->sharing()->Tend(name, &tidings); });
  if (failure) Log(LogLevel::kWarning, {}, failure->message);
  if (!failure && name.empty()) shared_->CountElsewhere(std::move(tidings.owners_bytes));
  for (const std::string& trouble : tidings.troubles) Log(LogLevel::kError, {}, trouble);
  for (const auto& [id, mesh] : tidings.meshes) {
    if (!Take(id, mesh)) {
      Log(LogLevel::kError, {},
          Message("mesh ", id, " of the database makes no sense, and is left as it is"));
    }
  }
  return TakeMeshes();
}

std::optional<Whereabouts> Journal::Locate(const std::string& name) {
  Whereabouts found;
  const auto failure = shared_->Do("nothing", FairMutex::Place::kFirst, [&](Records*) {
    return shared_->sharing()->Locate(name, &found);
  });
  if (failure) return std::nullopt;
  return found;
}

Journal::~Journal() { shared_->StopThreads(); }

std::shared_ptr<SessionJournal> Journal::NewMesh() {
  return std::make_shared<RecordedMesh>(shared_, options_.owner_bytes);
}

}  // namespace stellate::server
