#pragma once

namespace stellate::server {

enum class SessionState { kWaiting, kRunning, kSucceeded, kStopped, kCancelled, kFailed };

const char* SessionStateName(SessionState state);  // "SUCCEEDED", ...

}  // namespace stellate::server
