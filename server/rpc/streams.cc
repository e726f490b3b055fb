#include "server/rpc/streams.h"

#include <utility>

namespace stellate::server {

void StreamRegistry::Add(const std::shared_ptr<Stream>& stream) {
  bool stopping = false;
  {
    const std::lock_guard lock(mutex_);
    streams_.push_back(stream);
    stopping = stopping_;
  }
  if (stopping) stream->StopServing();
}

void StreamRegistry::Tick(TimePoint now) {
  for (const auto& stream : Living()) stream->Tick(now);
}

void StreamRegistry::StopAll() {
  {
    const std::lock_guard lock(mutex_);
    stopping_ = true;
  }
  for (const auto& stream : Living()) stream->StopServing();
}

std::size_t StreamRegistry::Count() const { return Living().size(); }

std::vector<std::shared_ptr<Stream>> StreamRegistry::Living() const {
  std::vector<std::shared_ptr<Stream>> living;
  const std::lock_guard lock(mutex_);
  std::erase_if(streams_, [&living](const std::weak_ptr<Stream>& weak) {
    auto stream = weak.lock();
    if (stream == nullptr) return true;
    living.push_back(std::move(stream));
    return false;
  });
  return living;
}

}  // namespace stellate::server
