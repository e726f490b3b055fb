#pragma once

#include <chrono>
#include <cstddef>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "core/status.h"
#include "server/session/session.h"

namespace stellate::server {

// What the server counts, in Prometheus's text format and for people; docs/running/metrics.md lists
// it. A counter costs an atomic addition; gauges are counted at each scrape. No metric names an
// owner or a mesh.
class Metrics {
 public:
  Metrics();
  ~Metrics();

  // Returns the meshes, for the gauges. Must outlive StopListening.
  using Sessions = std::function<std::vector<std::shared_ptr<Session>>()>;
  // Why no new meshes are taken; empty: they are.
  using WhyNot = std::function<std::string()>;
  // Answers http://address from now on: /metrics for Prometheus, /healthz for probes, / for people.
  // kFailedPrecondition: the address is taken.
  core::Status Listen(const std::string& address, Sessions sessions, WhyNot why_not);
  int port() const;  // 0: does not listen
  void StopListening();

  // Given to each session.
  std::shared_ptr<SessionObserver> observer() const;

  // Oracle streams: a chunk was answered, `seconds` after it was sent.
  void Answered(double seconds);
  void DatabaseAnswers(bool yes);
  void Share(std::size_t servers);                // that there are, where they share a database
  void TakenUp(std::size_t meshes);               // from servers that are gone
  void PassedOn();                                // a call, to another server
  void Refused();                                 // a call came without a good token
  void LimitReached(const std::string& setting);  // a call was refused by that limit
  // Count spans that a collector took, and those that none did; may outlive this.
  std::function<void(std::size_t)> SpansSent() const;
  std::function<void(std::size_t)> SpansDropped() const;
  // Bytes of messages on streams, before compression and framing.
  void Received(std::size_t bytes);
  void Sent(std::size_t bytes);

 private:
  class Impl;
  std::shared_ptr<Impl> impl_;
};

}  // namespace stellate::server
