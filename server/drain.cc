#include "server/drain.h"

#include <algorithm>
#include <thread>

namespace stellate::server {
namespace {

constexpr auto kPoll = std::chrono::milliseconds(20);
constexpr auto kReturn = std::chrono::seconds(1);  // for a worker that lost its stream

}  // namespace

void Drain(const ServerState& state, Clock::duration limit, const std::function<bool()>& hurry) {
  const TimePoint drained = Clock::now() + limit;
  const auto wait_while = [&](TimePoint until, const auto& busy) {
    while (busy() && Clock::now() < until && !hurry()) std::this_thread::sleep_for(kPoll);
  };
  // A mesh that nobody serves gets no further, however long it is waited for.
  TimePoint served = Clock::now();
  wait_while(drained, [&] {
    const TimePoint now = Clock::now();
    if (state.store.Served() > 0) served = now;
    return state.store.Running() > 0 && now - served < kReturn;
  });
  // Streams of finished meshes end by themselves, once read.
  if (state.store.Running() == 0) {
    wait_while(std::min(drained, Clock::now() + kLastWords),
               [&] { return state.streams.Count() > 0; });
  }
}

}  // namespace stellate::server
