#include "server/session/history_shelf.h"

#include <algorithm>
#include <limits>
#include <utility>

#include "server/base/log.h"

namespace stellate::server {

HistoryShelf::HistoryShelf(const SessionOptions& options) : options_(options) {
  if (!options_.record || !options_.record->result) {
    const core::Specification& spec = options_.request.spec;
    loaded_ = std::make_shared<MeshHistory>(spec.simplex_dimension(), spec.ambient_dimension,
                                            std::max(spec.labels_per_simplex(), 1));
    return;
  }
  const SessionResult& result = *options_.record->result;
  place_ = Place::kJournal;
  revision_ = result.revision;
  bytes_ = result.history_bytes;
  past_ = result.past;
  CountBytes();
}

core::Status HistoryShelf::Publish(const core::MeshDelta& delta, const PastProgress& now,
                                   const PointPlaces& places) {
  core::Status status = loaded_->Append(delta, places);  // which only this thread changes
  if (!status.ok()) return status;
  const std::lock_guard lock(mutex_);
  past_.Add(now);
  return status;
}

std::optional<MeshFailure> HistoryShelf::Record(const core::Progress& progress,
                                                const core::Report& report) {
  const SessionResult result{progress, report, loaded_->revision(), loaded_->MemoryBytes(), past_};
  if (auto failure = options_.ports.journal->WriteResult(result, *loaded_)) return failure;
  const std::lock_guard lock(mutex_);
  place_ = Place::kMemoryAndJournal;
  revision_ = result.revision;
  bytes_ = result.history_bytes;
  used_ = Clock::now();
  return std::nullopt;
}

std::shared_ptr<const MeshHistory> HistoryShelf::loaded() const {
  const std::lock_guard lock(mutex_);
  return loaded_;
}

std::uint64_t HistoryShelf::revision() const {
  const std::lock_guard lock(mutex_);
  return loaded_ != nullptr ? loaded_->revision() : revision_;
}

std::uint64_t HistoryShelf::PublishedRevision() const {
  const std::lock_guard lock(mutex_);
  if (place_ != Place::kMemory) return revision_;
  return std::max(loaded_->revision(), options_.record ? options_.record->rounds : 0);
}

std::uint64_t HistoryShelf::SeenRevision() const {
  const auto& record = options_.record;
  // If its replay failed, on the server before this one, no record tells how far it had got.
  if (record && record->end && record->end->state == SessionState::kFailed) {
    return std::numeric_limits<std::uint64_t>::max();
  }
  return std::max(PublishedRevision(), record ? record->rounds : 0);
}

std::vector<PastProgress> HistoryShelf::PastAfter(std::uint64_t revision) const {
  const std::lock_guard lock(mutex_);
  return past_.After(revision);
}

HistoryShelf::Loading HistoryShelf::Load() {
  if (loaded() != nullptr) {
    WakeWatchers();
    return Loading::kDone;
  }
  const MeshRequest& request = options_.request;
  const auto& memory = options_.ports.memory;
  if (memory != nullptr && memory->Set(EstimateFinishedBytes(request.spec) + bytes_)) {
    return Loading::kNoMemory;
  }
  auto read = options_.ports.journal->ReadHistory();
  if (!read) {
    Log(LogLevel::kError, {request.name, revision_, request.owner}, read.error().message);
  }
  const bool is_whole = read && (*read)->revision() == revision_;
  {
    const std::lock_guard lock(mutex_);
    place_ = is_whole ? Place::kMemoryAndJournal : Place::kLost;
    if (is_whole) loaded_ = std::move(*read);
    used_ = Clock::now();
  }
  CountBytes();
  WakeWatchers();
  return is_whole ? Loading::kDone : Loading::kFailed;
}

bool HistoryShelf::IsLost() const {
  const std::lock_guard lock(mutex_);
  return place_ == Place::kLost;
}

bool HistoryShelf::Unload(Clock::duration unused) {
  std::shared_ptr<MeshHistory> unloaded;  // freed without the lock
  {
    const std::lock_guard lock(mutex_);
    if (place_ != Place::kMemoryAndJournal) return false;
    const TimePoint now = Clock::now();
    if (loaded_.use_count() > 1) used_ = now;
    if (loaded_.use_count() > 1 || now - used_ < unused) return false;
    place_ = Place::kJournal;
    unloaded = std::move(loaded_);
  }
  unloaded.reset();
  CountBytes();
  return true;
}

void HistoryShelf::CountBytes() {
  const auto& memory = options_.ports.memory;
  if (memory == nullptr) return;
  const auto held = loaded();
  const std::uint64_t bytes = held != nullptr ? held->MemoryBytes() : 0;
  memory->SetUnchecked(EstimateFinishedBytes(options_.request.spec) + bytes);
}

bool HistoryShelf::AddWatcher(std::weak_ptr<SessionWatcher> watcher) {
  const std::lock_guard lock(mutex_);
  std::erase_if(watchers_, [](const auto& w) { return w.expired(); });
  if (watchers_.size() >= options_.policy.max_watchers) return false;
  watchers_.push_back(std::move(watcher));
  return true;
}

std::size_t HistoryShelf::watchers() const {
  const std::lock_guard lock(mutex_);
  return static_cast<std::size_t>(std::count_if(watchers_.begin(), watchers_.end(),
                                                [](const auto& w) { return !w.expired(); }));
}

void HistoryShelf::WakeWatchers() {
  std::vector<std::shared_ptr<SessionWatcher>> watchers;
  {
    const std::lock_guard lock(mutex_);
    for (const auto& weak : watchers_) {
      if (auto watcher = weak.lock()) watchers.push_back(std::move(watcher));
    }
  }
  for (const auto& watcher : watchers) watcher->Wake();
}

}  // namespace stellate::server
