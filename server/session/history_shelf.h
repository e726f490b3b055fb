#pragma once

#include <condition_variable>
#include <deque>
#include <memory>
#include <mutex>
#include <thread>

#include "server/session/session.h"

namespace stellate::server {

// Reads the histories of finished meshes back from their journal when somebody asks for them, one
// at a time, as far as the memory budget allows. Any thread.
class HistoryShelf {
 public:
  HistoryShelf() = default;
  ~HistoryShelf() { Stop(); }

  // Null: it will be there later, or lost; the session's watchers are woken then. Does not block.
  std::shared_ptr<const WatchLog> Open(const std::shared_ptr<Session>& session);
  // Reads no more.
  void Stop();

 private:
  void Load(const std::stop_token& stop);

  std::mutex mutex_;
  std::condition_variable_any wanted_changed_;
  std::deque<std::shared_ptr<Session>> wanted_;
  bool stopped_ = false;
  std::jthread thread_;  // from the first that is wanted
};

}  // namespace stellate::server
