#pragma once

#include <chrono>
#include <functional>

#include "server/base/clock.h"
#include "server/rpc/server_state.h"

namespace stellate::server {

inline constexpr std::chrono::seconds kLastWords{2};  // for streams to send what they have

// Waits up to `limit` for running meshes to end, as long as any of them has a worker, and then for
// their streams to be read. `hurry` is asked now and then; true ends it.
void Drain(const ServerState& state, Clock::duration limit, const std::function<bool()>& hurry);

}  // namespace stellate::server
