#include "server/journal.h"

#include <algorithm>
#include <atomic>
#include <condition_variable>
#include <deque>
#include <mutex>
#include <thread>
#include <utility>

#include "core/message.h"
#include "server/journal_file.h"
#include "server/journal_format.h"
#include "server/log.h"

namespace stellate::server {
namespace {

using core::Message;

constexpr auto kRetry = std::chrono::seconds(1);  // of a removal that failed

}  // namespace

// Shared by the meshes: the file, and a thread that removes what was deleted, since those who
// delete must not wait for a disk.
class Journal::File {
 public:
  explicit File(std::unique_ptr<JournalFile> file) : file_(std::move(file)) {}

  // Runs `action` on the file, alone. What went wrong, if it returned false.
  template <typename Action>
  std::optional<MeshFailure> Do(const char* what, Action action) {
    const std::lock_guard lock(mutex_);
    if (action(*file_)) return std::nullopt;
    Sqlite& database = file_->database();
    const bool full = database.IsFull();
    MeshFailure failure{full ? "JOURNAL_FULL" : "JOURNAL_FAILED",
                        Message("the server cannot record ", what, ": ", database.error(),
                                full ? "; free space by deleting meshes, then mesh anew" : "")};
    database.Abandon();
    return failure;
  }

  std::vector<JournalFile::StoredMesh> TakeMeshes() { return file_->TakeMeshes(); }

  void StartErasing() {
    eraser_ = std::jthread([this](std::stop_token stop) { Erase(stop); });
  }
  // What is due is tried once more.
  void StopErasing() {
    {
      const std::lock_guard lock(due_mutex_);  // nothing is due any more after this
      eraser_.request_stop();
    }
    if (eraser_.joinable()) eraser_.join();
  }
  void EraseLater(std::shared_ptr<Mesh> mesh) {
    {
      const std::lock_guard lock(due_mutex_);
      if (eraser_.get_stop_token().stop_requested()) return;
      due_.push_back(std::move(mesh));
    }
    due_changed_.notify_one();
  }

 private:
  void Erase(std::stop_token stop);

  std::mutex mutex_;
  const std::unique_ptr<JournalFile> file_;
  std::mutex due_mutex_;  // never held while the disk is waited for
  std::condition_variable_any due_changed_;
  std::deque<std::shared_ptr<Mesh>> due_;
  std::jthread eraser_;
};

class Journal::Mesh final : public SessionJournal, public std::enable_shared_from_this<Mesh> {
 public:
  Mesh(std::shared_ptr<File> file, std::int64_t id) : file_(std::move(file)), id_(id) {}

  std::optional<MeshFailure> WriteStart(
      const SessionOptions& options, std::chrono::system_clock::time_point create_time) override {
    return file_->Do("the mesh", [&](JournalFile& file) {
      // Under the file's lock: a removal comes before, and is seen here, or after, and sees the id.
      return forgotten_ || file.AddMesh(EncodeStart(options, create_time), &id_);
    });
  }

  std::optional<MeshFailure> WriteRound(const core::QueryBatch& batch,
                                        const core::Answers& answers) override {
    if (forgotten_) return std::nullopt;
    const std::string record = EncodeAnswers(answers);
    const std::uint64_t questions = DigestOf(batch);
    return file_->Do("the answers of a round", [&](JournalFile& file) {
      return forgotten_ || file.AddRound(id_, batch.round, questions, record);
    });
  }

  std::optional<MeshFailure> WriteEnd(const SessionEnd& end) override {
    return file_->Do("the end of the mesh", [&](JournalFile& file) {
      return forgotten_ || id_ == 0 || file.SetEnd(id_, EncodeEnd(end));
    });
  }

  Replay ReadRound(const core::QueryBatch& batch) override {
    JournalFile::StoredRound stored;
    file_->Do("nothing", [&](JournalFile& file) {
      stored = file.ReadRound(id_, batch.round);
      return true;
    });
    if (!stored.found && stored.intact) return {};
    std::optional<core::Answers> answers;
    if (stored.intact) answers = DecodeAnswers(stored.answers);
    if (!answers) {
      return {std::nullopt,
              MeshFailure{"JOURNAL_FAILED",
                          Message("the record of round ", batch.round, " cannot be read back")}};
    }
    if (stored.questions != DigestOf(batch)) {
      return {std::nullopt,
              MeshFailure{"REPLAY_MISMATCH",
                          Message("in round ", batch.round,
                                  " this server asks other questions than the server that "
                                  "recorded the answers: mesh anew")}};
    }
    return {std::move(answers), std::nullopt};
  }

  void Forget() override {
    if (!forgotten_.exchange(true)) file_->EraseLater(shared_from_this());
  }

  // False: to be tried again. From the removing thread.
  bool Remove() {
    const auto failure = file_->Do("the removal of a mesh",
                                   [&](JournalFile& file) { return id_ == 0 || file.Remove(id_); });
    if (failure) Log(LogLevel::kWarning, {}, failure->message);
    return !failure;
  }

 private:
  const std::shared_ptr<File> file_;
  std::int64_t id_;  // 0: not recorded; under the file's lock once it can be forgotten
  std::atomic<bool> forgotten_{false};
};

void Journal::File::Erase(std::stop_token stop) {
  std::unique_lock lock(due_mutex_);
  while (true) {
    due_changed_.wait(lock, stop, [this] { return !due_.empty(); });
    std::deque<std::shared_ptr<Mesh>> due = std::exchange(due_, {});
    if (due.empty()) return;  // told to stop, and done
    lock.unlock();
    std::erase_if(due, [](const auto& mesh) { return mesh->Remove(); });
    lock.lock();
    if (stop.stop_requested()) due.clear();  // the next server has them, and may be told again
    due_.insert(due_.begin(), due.begin(), due.end());
    if (!due.empty()) due_changed_.wait_for(lock, stop, kRetry, [] { return false; });
  }
}

core::Expected<std::unique_ptr<Journal>> Journal::Open(const JournalOptions& options) {
  auto opened = JournalFile::Open(options.directory, options.max_bytes);
  if (!opened) return tl::unexpected(std::move(opened.error()));
  std::vector<JournalFile::StoredMesh> stored = (*opened)->TakeMeshes();
  std::unique_ptr<Journal> journal(new Journal(std::make_shared<File>(std::move(*opened))));
  for (const JournalFile::StoredMesh& mesh : stored) {
    SessionOptions recorded;
    SessionRecord record;
    record.rounds = mesh.rounds;
    if (!mesh.end.empty()) record.end = DecodeEnd(mesh.end);
    if (!DecodeStart(mesh.start, &recorded, &record.create_time) ||
        record.end.has_value() == mesh.end.empty()) {
      return core::Refuse(core::StatusCode::kFailedPrecondition,
                          Message("the journal in ", options.directory, " holds a mesh (", mesh.id,
                                  ") that makes no sense; it was left as it is: choose another "
                                  "--data-dir"));
    }
    if (record.end) record.rounds = std::min(record.rounds, record.end->rounds);
    recorded.record = std::move(record);
    recorded.journal = std::make_shared<Mesh>(journal->file_, mesh.id);
    journal->meshes_.push_back(std::move(recorded));
  }
  journal->file_->StartErasing();
  return journal;
}

Journal::~Journal() { file_->StopErasing(); }

std::shared_ptr<SessionJournal> Journal::NewMesh() { return std::make_shared<Mesh>(file_, 0); }

}  // namespace stellate::server
