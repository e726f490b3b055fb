// A session as others see it and act on it; session.cc is its own thread.

#include "server/session/session.h"

namespace stellate::server {

Life Session::life() const {
  const std::lock_guard lock(mutex_);
  return life_.now();
}

// Where the mesh must end now, breaks off what Run is waiting for, or computing.
void Session::Step(LifeEvent event) {
  {
    const std::lock_guard lock(mutex_);
    if (!life_.Step(event) || !MustEnd(life_.now())) return;
    if (computing_ != nullptr) computing_->Interrupt();
  }
  pool_.Interrupt();
  if (intake_ != nullptr) intake_->Interrupt();
}

void Session::Cancel() { Step(LifeEvent::kCancel); }

// Nobody will ask how it is oriented.
void Session::Abandon() {
  Step(LifeEvent::kAbandon);
  orienting_.Raise();
}

void Session::Suspend() {
  Step(LifeEvent::kSuspend);
  orienting_.Raise();
}

void Session::AbandonUnrun() {
  pool_.Shut();
  {
    const std::lock_guard lock(mutex_);
    if (!life_.Step(LifeEvent::kAbandonUnrun)) return;
    end_ = {SessionState::kCancelled, std::chrono::system_clock::now(), 0, {}, 0};
    report_ = core::Report{};
  }
  pool_.Close({});
  if (intake_ != nullptr) intake_->Close({});
  history_.WakeWatchers();
}

bool Session::Over() const { return life() == Life::kOver; }

bool Session::HasEnded() const { return server::HasEnded(life()); }

bool IsElsewhere(const Session& session) {
  const auto& journal = session.ports().journal;
  return journal != nullptr && journal->IsElsewhere();
}

bool IsBeyondLimit(const Session& session) {
  const auto& journal = session.ports().journal;
  return journal != nullptr && journal->IsBeyondLimit();
}

bool Session::IsReplaying() const { return server::IsReplaying(life()); }

SessionView Session::View() const {
  SessionView view;
  view.create_time = create_time_;
  view.workers = pool_.workers();
  view.waiting_queries = pool_.waiting();
  view.watchers = history_.watchers();
  if (ports().memory != nullptr) view.bytes = ports().memory->bytes();
  bool is_served = view.workers > 0;
  if (intake_ != nullptr) {
    view.workers = intake_->is_joined() ? 1 : 0;
    is_served = view.workers > 0 || intake_->is_complete();
    view.waiting_queries = request().points->points - intake_->rows();
  }
  const std::lock_guard lock(mutex_);
  view.revision = history_.revision();  // with the lock: the last one, where the end is seen
  view.progress = progress_;
  view.report = report_;
  if (end_) {
    view.state = end_->state;
    view.end_time = end_->time;
    view.elapsed_seconds = end_->elapsed_seconds;
    view.failure = end_->failure;
    view.progress.phase = core::Phase::kDone;
    return view;
  }
  view.elapsed_seconds = std::chrono::duration<double>(Clock::now() - created_).count();
  view.state = IsSeenAsCancelled(life_.now()) ? SessionState::kCancelled
               : is_served                    ? SessionState::kRunning
                                              : SessionState::kWaiting;
  if (intake_ != nullptr) intake_->Show(&view.progress);
  if (view.state == SessionState::kRunning && view.progress.is_foreseeable) {
    view.remaining_seconds =
        view.elapsed_seconds * (1 - view.progress.fraction) / view.progress.fraction;
  }
  return view;
}

bool Session::HasVertices() const {
  const std::lock_guard lock(mutex_);
  return progress_.vertices > 0;
}

LogContext Session::log_context() const {
  const std::lock_guard lock(mutex_);
  return {request().name, progress_.round, request().owner};
}

}  // namespace stellate::server
