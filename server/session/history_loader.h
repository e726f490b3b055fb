#pragma once

#include <condition_variable>
#include <deque>
#include <memory>
#include <mutex>
#include <thread>

#include "server/session/session.h"

namespace stellate::server {

// Loads the histories of finished meshes from their journals when watchers ask for them, one at a
// time, as far as the memory budget allows. Any thread.
class HistoryLoader {
 public:
  HistoryLoader() = default;
  ~HistoryLoader() { Stop(); }

  // Returns the session's history. Null: it is lost, or will be loaded, and wakes the session's
  // watchers then. Does not block.
  std::shared_ptr<const MeshHistory> Open(const std::shared_ptr<Session>& session);
  // Loads no further history.
  void Stop();

 private:
  void Load(const std::stop_token& stop);

  std::mutex mutex_;
  std::condition_variable_any wanted_changed_;
  std::deque<std::shared_ptr<Session>> wanted_;
  bool stopped_ = false;
  std::jthread thread_;  // starts with the first that is wanted
};

}  // namespace stellate::server
