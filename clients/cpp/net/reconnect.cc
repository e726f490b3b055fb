#include "net/reconnect.h"

#include <algorithm>
#include <cstdio>
#include <utility>

#include "shared/reconnect.h"
#include "wire/status.h"

namespace stellate::client {
namespace {

using Clock = std::chrono::steady_clock;

}  // namespace

bool IsTransient(const grpc::Status& status) {
  switch (status.error_code()) {
    case grpc::StatusCode::UNAVAILABLE:
    case grpc::StatusCode::CANCELLED:
      return true;
    case grpc::StatusCode::UNKNOWN:
      // What gRPC says of a stream whose connection went while it was being opened.
      return status.error_message().find("Stream removed") != std::string::npos;
    default:
      return false;
  }
}

Error Explain(const grpc::Status& status, bool reconnecting) {
  Error error = FromStatus(status);
  if (reconnecting && status.error_code() == grpc::StatusCode::NOT_FOUND) {
    error.code = ErrorCode::kServerFailed;
    error.message =
        "the server went away and came back without the mesh; it keeps meshes only with --data-dir";
  }
  return error;
}

const Seconds Backoff::kFirst{reconnect::kFirstPause};
const Seconds Backoff::kLongest{reconnect::kLongestPause};

Seconds Backoff::Next() {
  const Seconds full = next_;
  next_ = std::min(reconnect::kPauseGrowth * next_, kLongest);
  return full * (1 - std::uniform_real_distribution<double>(0, reconnect::kPauseJitter)(random_));
}

Reconnector::Reconnector(ReconnectPolicy policy)
    : policy_(std::move(policy)), backoff_(std::random_device{}()) {}

grpc::ClientContext& Reconnector::Attempt() {
  const std::lock_guard lock(mutex_);
  context_ = std::make_unique<grpc::ClientContext>();
  if (stopped_) context_->TryCancel();
  return *context_;
}

void Reconnector::Heard() {
  if (attempts_ == 0) return;
  const Outage outage{true, Clock::now() - lost_, attempts_, ""};
  attempts_ = 0;
  backoff_.Reset();
  if (policy_.on_outage) policy_.on_outage(outage);
}

bool Reconnector::Again(const grpc::Status& status) {
  if (!IsTransient(status)) return false;
  if (policy_.hopeless && policy_.hopeless()) return false;
  const Clock::time_point now = Clock::now();
  if (attempts_ == 0) lost_ = now;
  const Seconds left = policy_.give_up - Seconds(now - lost_);
  if (left <= Seconds(0) || stopped()) return false;
  ++attempts_;
  if (policy_.on_outage) {
    policy_.on_outage({false, now - lost_, attempts_, status.error_message()});
  }
  if (!Pause(std::min(backoff_.Next(), left))) return false;
  Connect();
  return !stopped();
}

bool Reconnector::Pause(Seconds pause) {
  std::unique_lock lock(mutex_);
  return !wake_.wait_for(lock, pause, [this] { return stopped_ || finished_; });
}

Error Reconnector::Lost(const grpc::Status& status) const {
  Error error = Explain(status, reconnecting());
  if (status.error_code() == grpc::StatusCode::NOT_FOUND) return error;
  if (status.error_code() == grpc::StatusCode::CANCELLED) {
    error.message = "the server broke off";
  } else if (reconnecting()) {
    char waited[64];
    std::snprintf(waited, sizeof waited, "; waited %.4g s for it", policy_.give_up.count());
    error.message += waited;
  }
  return error;
}

// Connections come about only while somebody waits for them, and a call that finds none fails
// at once.
void Reconnector::Connect() {
  constexpr int kSlices = 20;
  constexpr auto kSlice =
      std::chrono::milliseconds(static_cast<int>(1000 * reconnect::kConnect / kSlices));
  for (int i = 0; policy_.channel && i < kSlices && !stopped(); ++i) {
    if (policy_.channel->WaitForConnected(std::chrono::system_clock::now() + kSlice)) return;
  }
}

void Reconnector::Stop() {
  const std::lock_guard lock(mutex_);
  stopped_ = true;
  if (context_) context_->TryCancel();
  wake_.notify_all();
}

void Reconnector::Finish() {
  const std::lock_guard lock(mutex_);
  finished_ = true;
  wake_.notify_all();
}

bool Reconnector::stopped() const {
  const std::lock_guard lock(mutex_);
  return stopped_ || finished_;
}

}  // namespace stellate::client
