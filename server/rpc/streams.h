#pragma once

#include <memory>
#include <mutex>
#include <vector>

#include "server/base/clock.h"

namespace stellate::server {

// A call that lasts. Both methods are called on any thread and must not block.
class Stream {
 public:
  virtual ~Stream() = default;
  virtual void Tick(TimePoint now) = 0;  // about once a second
  virtual void StopServing() = 0;        // the server stops: end with UNAVAILABLE
};

// The open streams of a server.
class StreamRegistry {
 public:
  // Stops the stream immediately if the server is stopping already.
  void Add(const std::shared_ptr<Stream>& stream);
  void Tick(TimePoint now);
  void StopAll();
  std::size_t Count() const;

 private:
  std::vector<std::shared_ptr<Stream>> Living() const;

  mutable std::mutex mutex_;
  mutable std::vector<std::weak_ptr<Stream>> streams_;
  bool stopping_ = false;
};

}  // namespace stellate::server
