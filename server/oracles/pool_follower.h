#pragma once

#include <string>

#include "server/oracles/dispatch.h"
#include "server/spans/trace_context.h"

namespace stellate::server {

// Follows who serves one pool, and with what. Called in the order of events with the pool's lock
// held: must not block, nor call the pool.
class PoolFollower {
 public:
  virtual ~PoolFollower() = default;
  // `trace`: that the worker came with.
  virtual void OnJoined(WorkerId worker, const std::string& name, const TraceHeaders& trace) = 0;
  virtual void OnLeft(WorkerId worker) = 0;
  virtual void OnAsked(const Lease& lease) = 0;
  virtual void OnAnswered(LeaseId lease, Dispatch::AcceptResult result) = 0;
};

}  // namespace stellate::server
