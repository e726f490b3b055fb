// A session as others see it and act on it; session.cc is its own thread.

#include <algorithm>
#include <utility>

#include "server/session/session.h"

namespace stellate::server {

void Session::Cancel() {
  {
    const std::lock_guard lock(mutex_);
    if (ending_ || final_state_ || (options_.record && options_.record->end)) return;
    cancelled_ = true;
  }
  if (!replaying_) Interrupt();
}

void Session::Abandon() {
  abandoned_ = true;
  cancelled_ = true;
  Interrupt();
}

void Session::AbandonUnrun() {
  Abandon();
  pool_.Shut();
  {
    const std::lock_guard lock(mutex_);
    final_state_ = SessionState::kCancelled;
    report_ = core::Report{};
    end_time_ = std::chrono::system_clock::now();
  }
  over_ = true;
  pool_.Close({blame_});
  WakeWatchers();
}

void Session::Interrupt() {
  {
    const std::lock_guard lock(mutex_);
    if (ending_) return;
    if (computing_ != nullptr) computing_->Interrupt();
  }
  pool_.Interrupt();
}

void Session::Suspend() {
  stopping_ = true;
  {
    const std::lock_guard lock(mutex_);
    suspended_ = ports().journal != nullptr && !cancelled_;
  }
  Abandon();
}

std::uint64_t Session::PublishedRevision() const {
  const std::lock_guard lock(mutex_);
  if (result_is_recorded_) return revision_;
  return std::max(history_->revision(), options_.record ? options_.record->rounds : 0);
}

std::uint64_t Session::revision() const {
  const std::lock_guard lock(mutex_);
  return history_ != nullptr ? history_->revision() : revision_;
}

std::shared_ptr<const WatchLog> Session::history() const {
  const std::lock_guard lock(mutex_);
  return history_;
}

bool Session::HistoryIsLost() const {
  const std::lock_guard lock(mutex_);
  return history_is_lost_;
}

Session::Loading Session::LoadHistory() {
  if (history() != nullptr) {
    WakeWatchers();
    return Loading::kDone;
  }
  const std::uint64_t bytes = EstimateFinishedBytes(request().spec) + history_bytes_;
  if (ports().memory != nullptr && ports().memory->Set(bytes)) return Loading::kNoMemory;
  auto read = ports().journal->ReadHistory();
  {
    const std::lock_guard lock(mutex_);
    history_is_lost_ = !read || (*read)->revision() != revision_;
    if (!history_is_lost_) history_ = std::move(*read);
    history_used_ = Clock::now();
  }
  if (!read) Log(LogLevel::kError, log_context(), read.error().message);
  CountHistory();
  WakeWatchers();
  return HistoryIsLost() ? Loading::kFailed : Loading::kDone;
}

bool Session::PutAwayHistory(Clock::duration unused) {
  std::shared_ptr<WatchLog> history;  // freed without the lock
  {
    const std::lock_guard lock(mutex_);
    if (history_ == nullptr || !result_is_recorded_) return false;
    const TimePoint now = Clock::now();
    if (history_.use_count() > 1) history_used_ = now;
    if (history_.use_count() > 1 || now - history_used_ < unused) return false;
    history = std::move(history_);
  }
  history.reset();
  CountHistory();
  return true;
}

void Session::CountHistory() {
  if (ports().memory == nullptr) return;
  const auto held = history();
  const std::uint64_t bytes = held != nullptr ? held->MemoryBytes() : 0;
  ports().memory->SetUnchecked(EstimateFinishedBytes(request().spec) + bytes);
}

bool Session::AddWatcher(std::weak_ptr<SessionWatcher> watcher) {
  const std::lock_guard lock(mutex_);
  std::erase_if(watchers_, [](const auto& w) { return w.expired(); });
  if (watchers_.size() >= policy().max_watchers) return false;
  watchers_.push_back(std::move(watcher));
  return true;
}

void Session::WakeWatchers() {
  std::vector<std::shared_ptr<SessionWatcher>> watchers;
  {
    const std::lock_guard lock(mutex_);
    for (const auto& weak : watchers_) {
      if (auto watcher = weak.lock()) watchers.push_back(std::move(watcher));
    }
  }
  for (const auto& watcher : watchers) watcher->Wake();
}

SessionView Session::View() const {
  SessionView view;
  view.workers = pool_.workers();
  view.waiting_queries = pool_.waiting();
  if (ports().memory != nullptr) view.bytes = ports().memory->bytes();
  const std::lock_guard lock(mutex_);
  view.revision = history_ != nullptr ? history_->revision() : revision_;
  view.create_time = create_time_;
  view.end_time = end_time_;
  view.progress = progress_;
  view.report = report_;
  view.failure = failure_;
  view.watchers =
      std::count_if(watchers_.begin(), watchers_.end(), [](const auto& w) { return !w.expired(); });
  if (final_state_) {
    view.state = *final_state_;
    view.elapsed_seconds = final_seconds_;
    view.progress.phase = core::Phase::kDone;
    return view;
  }
  view.elapsed_seconds = std::chrono::duration<double>(Clock::now() - created_).count();
  // A cancelled mesh is over for its owner, even while its last round is being computed.
  view.state = cancelled_          ? SessionState::kCancelled
               : view.workers == 0 ? SessionState::kWaiting
                                   : SessionState::kRunning;
  if (view.state == SessionState::kRunning && view.progress.is_foreseeable) {
    view.remaining_seconds =
        view.elapsed_seconds * (1 - view.progress.fraction) / view.progress.fraction;
  }
  return view;
}

std::vector<PastProgress> Session::PastAfter(std::uint64_t revision) const {
  const std::lock_guard lock(mutex_);
  return past_.After(revision);
}

bool Session::HasVertices() const {
  const std::lock_guard lock(mutex_);
  return progress_.vertices > 0;
}

bool Session::HasEnded() const {
  const std::lock_guard lock(mutex_);
  return final_state_.has_value();
}

LogContext Session::log_context() const {
  const std::lock_guard lock(mutex_);
  return {request().name, progress_.round, request().owner};
}

}  // namespace stellate::server
