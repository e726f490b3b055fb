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
#include "server/turns.h"

namespace stellate::server {
namespace {

using core::Message;

constexpr auto kRetry = std::chrono::seconds(1);  // of a removal that failed

}  // namespace

// Shared by the meshes: the file, and a thread that keeps it in order, since neither those who
// delete nor those who mesh should wait for that. It works in pieces, between which others write.
class Journal::File {
 public:
  explicit File(std::unique_ptr<JournalFile> file) : file_(std::move(file)) {}

  // Runs `action` on the file, alone. What went wrong, if it returned false.
  template <typename Action>
  std::optional<MeshFailure> Do(const char* what, Turns::Place place, Action action) {
    std::optional<MeshFailure> failure;
    bool is_long = false;
    {
      const Turn turn(turns_, place);
      if (!action(*file_)) failure = WhyNot(what);
      is_long = file_->IsLogLong();
    }
    if (is_long) NoteLongLog();
    return failure;
  }

  std::vector<JournalFile::StoredMesh> TakeMeshes() { return file_->TakeMeshes(); }

  void StartKeeping() {
    space_is_due_ = file_->HasSpaceToGiveBack();  // that an earlier server did not come to
    keeper_ = std::jthread([this](std::stop_token stop) { Keep(stop); });
  }
  // What is due is tried once more.
  void StopKeeping() {
    {
      const std::lock_guard lock(due_mutex_);  // nothing is due any more after this
      keeper_.request_stop();
    }
    if (keeper_.joinable()) keeper_.join();
  }
  void EraseLater(std::shared_ptr<Mesh> mesh) {
    {
      const std::lock_guard lock(due_mutex_);
      if (keeper_.get_stop_token().stop_requested()) return;
      due_.push_back(std::move(mesh));
    }
    due_changed_.notify_one();
  }

 private:
  MeshFailure WhyNot(const char* what);
  void NoteLongLog();
  void Keep(std::stop_token stop);
  void Checkpoint();
  bool GiveBackSome(bool* done);

  Turns turns_;
  const std::unique_ptr<JournalFile> file_;
  std::mutex due_mutex_;  // never held while the disk is waited for
  std::condition_variable_any due_changed_;
  std::deque<std::shared_ptr<Mesh>> due_;
  bool log_is_long_ = false;
  bool space_is_due_ = false;  // of what was removed
  std::jthread keeper_;
};

class Journal::Mesh final : public SessionJournal, public std::enable_shared_from_this<Mesh> {
 public:
  Mesh(std::shared_ptr<File> file, std::int64_t id) : file_(std::move(file)), id_(id) {}

  std::optional<MeshFailure> WriteStart(
      const SessionOptions& options, std::chrono::system_clock::time_point create_time) override {
    return file_->Do("the mesh", Turns::Place::kLast, [&](JournalFile& file) {
      // Under the file's lock: a removal comes before, and is seen here, or after, and sees the id.
      return forgotten_ || file.AddMesh(EncodeStart(options, create_time), &id_);
    });
  }

  std::optional<MeshFailure> WriteRound(const core::QueryBatch& batch,
                                        const core::Answers& answers) override {
    if (forgotten_) return std::nullopt;
    const std::string record = EncodeAnswers(answers);
    const std::uint64_t questions = DigestOf(batch);
    return file_->Do("the answers of a round", Turns::Place::kLast, [&](JournalFile& file) {
      return forgotten_ || file.AddRound(id_, batch.round, questions, record);
    });
  }

  // It is short, and others wait for it.
  std::optional<MeshFailure> WriteEnd(const SessionEnd& end) override {
    if (forgotten_) return std::nullopt;
    return file_->Do("the end of the mesh", Turns::Place::kFirst, [&](JournalFile& file) {
      return forgotten_ || id_ == 0 || file.SetEnd(id_, EncodeEnd(end));
    });
  }

  Replay ReadRound(const core::QueryBatch& batch) override {
    JournalFile::StoredRound stored;
    file_->Do("nothing", Turns::Place::kLast, [&](JournalFile& file) {
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

  // Some of it; `done` once all is. False: to be tried again. From the keeping thread.
  bool RemoveSome(bool* done) {
    const auto failure =
        file_->Do("the removal of a mesh", Turns::Place::kLast, [&](JournalFile& file) {
          *done = id_ == 0;
          return *done || file.RemoveSome(id_, EncodeEnd(RemovedEnd()), done);
        });
    if (failure) Log(LogLevel::kWarning, {}, failure->message);
    return !failure;
  }

 private:
  const std::shared_ptr<File> file_;
  std::int64_t id_;  // 0: not recorded; under the file's lock once it can be forgotten
  std::atomic<bool> forgotten_{false};
};

MeshFailure Journal::File::WhyNot(const char* what) {
  Sqlite& database = file_->database();
  const bool full = database.IsFull();
  MeshFailure failure{full ? "JOURNAL_FULL" : "JOURNAL_FAILED",
                      Message("the server cannot record ", what, ": ", database.error(),
                              full ? "; free space by deleting meshes, then mesh anew" : "")};
  database.Abandon();
  return failure;
}

void Journal::File::NoteLongLog() {
  {
    const std::lock_guard lock(due_mutex_);
    log_is_long_ = true;
  }
  due_changed_.notify_one();
}

void Journal::File::Keep(std::stop_token stop) {
  std::unique_lock lock(due_mutex_);
  const auto is_due = [this] { return log_is_long_ || space_is_due_ || !due_.empty(); };
  while (due_changed_.wait(lock, stop, is_due)) {  // told to stop, until nothing is due
    if (std::exchange(log_is_long_, false)) {
      lock.unlock();
      Checkpoint();
      lock.lock();
      continue;
    }
    const std::shared_ptr<Mesh> mesh = due_.empty() ? nullptr : due_.front();
    bool done = false;
    lock.unlock();
    const bool kept = mesh != nullptr ? mesh->RemoveSome(&done) : GiveBackSome(&done);
    lock.lock();
    if (!kept) done = stop.stop_requested();  // the rest is the next server's
    if (mesh == nullptr) {
      space_is_due_ = !done;
    } else {
      space_is_due_ = true;
      if (done || !kept) due_.pop_front();
      if (!done && !kept) due_.push_back(mesh);  // behind others
    }
    if (!done && !kept) due_changed_.wait_for(lock, stop, kRetry, [] { return false; });
  }
}

void Journal::File::Checkpoint() {
  const Turn turn(turns_, Turns::Place::kFirst);
  // If this fails the log grows on, until a write fails and says why.
  if (!file_->Checkpoint()) file_->database().Abandon();
}

bool Journal::File::GiveBackSome(bool* done) {
  const auto failure = Do("what was removed", Turns::Place::kLast,
                          [&](JournalFile& file) { return file.GiveBackSome(done); });
  if (failure) Log(LogLevel::kWarning, {}, failure->message);
  return !failure;
}

core::Expected<std::unique_ptr<Journal>> Journal::Open(const JournalOptions& options) {
  auto opened = JournalFile::Open(options.directory, options.max_bytes);
  if (!opened) return tl::unexpected(std::move(opened.error()));
  std::vector<JournalFile::StoredMesh> stored = (*opened)->TakeMeshes();
  std::unique_ptr<Journal> journal(new Journal(std::make_shared<File>(std::move(*opened))));
  std::vector<std::shared_ptr<Mesh>> half_removed;
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
    const auto place = std::make_shared<Mesh>(journal->file_, mesh.id);
    if (record.end && IsRemoved(*record.end)) {
      half_removed.push_back(place);
      continue;
    }
    if (record.end) record.rounds = std::min(record.rounds, record.end->rounds);
    recorded.record = std::move(record);
    recorded.journal = place;
    journal->meshes_.push_back(std::move(recorded));
  }
  for (const auto& place : half_removed) place->Forget();
  journal->file_->StartKeeping();
  return journal;
}

Journal::~Journal() { file_->StopKeeping(); }

std::shared_ptr<SessionJournal> Journal::NewMesh() { return std::make_shared<Mesh>(file_, 0); }

}  // namespace stellate::server
