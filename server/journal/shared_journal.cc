#include "server/journal/shared_journal.h"

#include <algorithm>
#include <utility>

#include "core/base/message.h"
#include "server/base/log.h"

namespace stellate::server {
namespace {

using core::Message;

constexpr auto kRetry = std::chrono::seconds(1);  // of a removal that failed
constexpr auto kSync = std::chrono::seconds(1);   // of the mark
// Answers are gathered for at least kGather, and for a multiple of the time that writing the last
// ones took, so that they keep the disk busy for about a tenth of the time. A round that is over
// sooner is written at once and whole.
constexpr Clock::duration kGather = std::chrono::milliseconds(50);
constexpr Clock::duration kLongestGather = std::chrono::milliseconds(250);
constexpr int kGatherShare = 10;

}  // namespace

std::optional<MeshFailure> SharedJournal::Do(const char* what, FairMutex::Place place,
                                             const std::function<bool(Records*)>& action) {
  std::optional<MeshFailure> failure;
  bool is_long = false;
  {
    const FairLock turn(mutex_, place);
    if (!action(records_.get())) failure = WhyNot(what);
    is_long = records_->IsLogLong();
  }
  if (is_long) NoteLongLog();
  return failure;
}

MeshFailure SharedJournal::WhyNot(const char* what) {
  const auto [full, message, refusal] = records_->trouble();
  if (refusal == Records::Trouble::Refusal::kTooMany) {
    records_->Abandon();
    return {FailureReason::kLimitExceeded, message};
  }
  MeshFailure failure{full ? FailureReason::kJournalFull : FailureReason::kJournalFailed,
                      Message("the server cannot record ", what, ": ", message,
                              full ? "; free space by deleting meshes, then mesh again" : "")};
  records_->Abandon();
  return failure;
}

void SharedJournal::StartThreads() {
  space_is_due_ = records_->HasSpaceToGiveBack();  // that an earlier server did not come to
  writer_ = std::jthread([this](const std::stop_token& stop) { Write(stop); });
  keeper_ = std::jthread([this](const std::stop_token& stop) { Keep(stop); });
}

void SharedJournal::StopThreads() {
  {
    const std::lock_guard lock(due_mutex_);  // nothing is due any more after this
    writer_.request_stop();
    keeper_.request_stop();
  }
  if (writer_.joinable()) writer_.join();
  if (keeper_.joinable()) keeper_.join();
}

void SharedJournal::WriteAnswersLater(std::shared_ptr<Mesh> mesh) {
  {
    const std::lock_guard lock(due_mutex_);
    if (std::find(writing_.begin(), writing_.end(), mesh) != writing_.end()) return;
    writing_.push_back(std::move(mesh));
  }
  answers_due_.notify_one();
}

void SharedJournal::RemoveLater(std::shared_ptr<Mesh> mesh) {
  {
    const std::lock_guard lock(due_mutex_);
    if (keeper_.get_stop_token().stop_requested()) return;
    removing_.push_back(std::move(mesh));
  }
  work_due_.notify_one();
}

void SharedJournal::NoteLongLog() {
  {
    const std::lock_guard lock(due_mutex_);
    log_is_long_ = true;
  }
  work_due_.notify_one();
}

// All meshes' answers in one transaction.
void SharedJournal::Write(const std::stop_token& stop) {
  std::unique_lock lock(due_mutex_);
  Clock::duration gather = kGather;
  while (answers_due_.wait(lock, stop, [this] { return !writing_.empty(); })) {
    answers_due_.wait_for(lock, stop, gather, [] { return false; });
    const auto meshes = std::exchange(writing_, {});
    lock.unlock();
    const TimePoint begin = Clock::now();
    // If this fails the end of the round, which writes what is missing, says why.
    Do("answers", FairMutex::Place::kLast, [&meshes](Records* records) {
      std::vector<Mesh*> ready;
      for (const auto& mesh : meshes) {
        if (mesh->HasAnswers()) ready.push_back(mesh.get());
      }
      const bool written = ready.empty() || records->Transact([&] {
        return std::all_of(ready.begin(), ready.end(),
                           [&](Mesh* mesh) { return mesh->WriteAnswers(records); });
      });
      for (Mesh* const mesh : ready) mesh->AnswersWritten(written);
      return written;
    });
    gather = std::clamp(kGatherShare * (Clock::now() - begin), kGather, kLongestGather);
    lock.lock();
  }
}

void SharedJournal::Keep(const std::stop_token& stop) {
  std::unique_lock lock(due_mutex_);
  const auto is_due = [this] { return log_is_long_ || space_is_due_ || !removing_.empty(); };
  while (true) {
    if (!work_due_.wait_for(lock, stop, kSync, is_due)) {  // asked to stop, until nothing is due
      if (stop.stop_requested()) return;
      lock.unlock();
      Do("the mark", FairMutex::Place::kFirst,
         [](Records* records) { return records->SyncMark(), true; });
      lock.lock();
      continue;
    }
    if (std::exchange(log_is_long_, false)) {
      lock.unlock();
      Checkpoint();
      lock.lock();
      continue;
    }
    const std::shared_ptr<Mesh> mesh = removing_.empty() ? nullptr : removing_.front();
    bool done = false;
    lock.unlock();
    const bool kept = mesh != nullptr ? RemoveSome(mesh.get(), &done) : GiveBackSome(&done);
    lock.lock();
    if (!kept) done = stop.stop_requested();  // the rest is the next server's
    if (mesh == nullptr) {
      space_is_due_ = !done;
    } else {
      space_is_due_ = true;
      if (done || !kept) removing_.pop_front();
      if (!done && !kept) removing_.push_back(mesh);  // behind others
    }
    if (!done && !kept) work_due_.wait_for(lock, stop, kRetry, [] { return false; });
  }
}

void SharedJournal::Checkpoint() {
  const FairLock turn(mutex_, FairMutex::Place::kFirst);
  // If this fails the log grows on, until a write fails and says why.
  if (!records_->Checkpoint()) records_->Abandon();
}

bool SharedJournal::RemoveSome(Mesh* mesh, bool* done) {
  const auto failure = Do("the removal of a mesh", FairMutex::Place::kLast,
                          [&](Records* records) { return mesh->RemoveSome(records, done); });
  if (failure) Log(LogLevel::kWarning, {}, failure->message);
  return !failure;
}

bool SharedJournal::GiveBackSome(bool* done) {
  const auto failure = Do("what was removed", FairMutex::Place::kLast,
                          [&](Records* records) { return records->GiveBackSome(done); });
  if (failure) Log(LogLevel::kWarning, {}, failure->message);
  return !failure;
}

std::uint64_t SharedJournal::OwnerBytes(const std::string& owner) const {
  const std::lock_guard lock(counts_mutex_);
  std::uint64_t bytes = 0;
  for (const auto* all : {&owner_bytes_, &elsewhere_bytes_}) {
    if (const auto it = all->find(owner); it != all->end()) bytes += it->second;
  }
  return bytes;
}

std::uint64_t SharedJournal::TotalBytes() const {
  const std::lock_guard lock(counts_mutex_);
  std::uint64_t bytes = total_bytes_;
  for (const auto& [owner, elsewhere] : elsewhere_bytes_) bytes += elsewhere;
  return bytes;
}

void SharedJournal::CountElsewhere(std::map<std::string, std::uint64_t> owners_bytes) {
  const std::lock_guard lock(counts_mutex_);
  elsewhere_bytes_ = std::move(owners_bytes);
}

void SharedJournal::CountFor(const std::string& owner, std::int64_t bytes) {
  const std::lock_guard lock(counts_mutex_);
  std::uint64_t& total = owner_bytes_[owner];
  total += static_cast<std::uint64_t>(bytes);
  total_bytes_ += static_cast<std::uint64_t>(bytes);
  if (total == 0) owner_bytes_.erase(owner);
}

}  // namespace stellate::server
