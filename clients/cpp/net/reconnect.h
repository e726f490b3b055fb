#pragma once

#include <grpcpp/channel.h>
#include <grpcpp/client_context.h>
#include <grpcpp/support/status.h>

#include <chrono>
#include <condition_variable>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <random>

#include "stellate/connection.h"
#include "stellate/error.h"

namespace stellate::client {

// Whether the server, or the way to it, was lost, so that the same call may succeed later. What a
// server drops arrives as CANCELLED where this side cancelled nothing.
bool IsTransient(const grpc::Status& status);

// The error that a stream's end stands for; `reconnecting` as of the Reconnector.
Error Explain(const grpc::Status& status, bool reconnecting);

// The pauses between attempts: longer each time up to a limit, each shortened at random, so that
// the clients of a server that comes back do not all come together.
class Backoff {
 public:
  explicit Backoff(std::uint64_t random_seed) : random_(random_seed) {}
  Seconds Next();
  void Reset() { next_ = kFirst; }

  static const Seconds kFirst, kLongest;

 private:
  Seconds next_ = kFirst;
  std::mt19937_64 random_;
};

struct ReconnectPolicy {
  Seconds give_up{0};                            // without a sign of life for so long
  std::shared_ptr<grpc::Channel> channel;        // of the streams; may be null
  std::function<bool()> hopeless;                // true: it will not come back; may be empty
  std::function<void(const Outage&)> on_outage;  // called by Again and Heard; may be empty
};

// The attempts at one stream, each with a context of its own. One thread makes them; any other may
// end them.
class Reconnector {
 public:
  explicit Reconnector(ReconnectPolicy policy);

  // The context of a new attempt, good until the next.
  grpc::ClientContext& Attempt();
  // The attempt brought something: the server is there.
  void Heard();
  // After an attempt ended with `status`: waits, and says whether to make another.
  bool Again(const grpc::Status& status);
  // Waits; false when it was stopped.
  bool Pause(Seconds pause);
  // Whether the last attempt follows on one that was broken off.
  bool reconnecting() const { return attempts_ > 0; }

  // What to say when no other attempt is made after `status`.
  Error Lost(const grpc::Status& status) const;

  // Cancels the attempt under way, and makes no other.
  void Stop();
  // Makes no other.
  void Finish();
  bool stopped() const;

 private:
  const ReconnectPolicy policy_;
  Backoff backoff_;
  int attempts_ = 0;  // since something was heard
  std::chrono::steady_clock::time_point lost_;

  void Connect();

  mutable std::mutex mutex_;
  std::condition_variable wake_;
  bool stopped_ = false, finished_ = false;
  std::unique_ptr<grpc::ClientContext> context_;
};

}  // namespace stellate::client
