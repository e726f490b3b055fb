#include "server/session/session_state.h"

namespace stellate::server {

const char* SessionStateName(SessionState state) {
  switch (state) {
    case SessionState::kWaiting:
      return "WAITING";
    case SessionState::kRunning:
      return "RUNNING";
    case SessionState::kSucceeded:
      return "SUCCEEDED";
    case SessionState::kStopped:
      return "STOPPED";
    case SessionState::kCancelled:
      return "CANCELLED";
    case SessionState::kFailed:
      return "FAILED";
  }
  return "UNKNOWN";
}

}  // namespace stellate::server
