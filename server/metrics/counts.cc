#include "server/metrics/counts.h"

namespace stellate::server {

Counts CountAll(const std::vector<std::shared_ptr<Session>>& sessions) {
  Counts counts;
  for (const SessionState state :
       {SessionState::kWaiting, SessionState::kRunning, SessionState::kSucceeded,
        SessionState::kStopped, SessionState::kCancelled, SessionState::kFailed})
    counts.states[state] = 0;
  for (const auto& session : sessions) {
    const SessionView view = session->View();
    ++counts.states[view.state];
    counts.workers += view.workers;
    counts.watchers += view.watchers;
    counts.vertices += view.progress.vertices;
    counts.waiting += view.waiting_queries;
    counts.bytes += view.bytes;
    if (view.workers == 0 && view.waiting_queries > 0 && !session->HasEnded()) ++counts.idle;
  }
  return counts;
}

}  // namespace stellate::server
