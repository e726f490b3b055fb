#include "server/session/history_loader.h"

#include <algorithm>
#include <utility>

namespace stellate::server {
namespace {

constexpr auto kRetryLoading = std::chrono::seconds(1);  // where there was no memory

}  // namespace

std::shared_ptr<const MeshHistory> HistoryLoader::Open(const std::shared_ptr<Session>& session) {
  auto history = session->history().loaded();
  if (history != nullptr || session->history().IsLost()) return history;
  {
    const std::lock_guard lock(mutex_);
    if (stopped_ || std::find(wanted_.begin(), wanted_.end(), session) != wanted_.end()) {
      return nullptr;
    }
    wanted_.push_back(session);
    if (!thread_.joinable())
      thread_ = std::jthread([this](const std::stop_token& stop) { Load(stop); });
  }
  wanted_changed_.notify_one();
  return nullptr;
}

void HistoryLoader::Stop() {
  {
    const std::lock_guard lock(mutex_);
    stopped_ = true;
    wanted_.clear();
  }
  if (!thread_.joinable()) return;
  thread_.request_stop();
  thread_.join();
}

void HistoryLoader::Load(const std::stop_token& stop) {
  std::unique_lock lock(mutex_);
  while (wanted_changed_.wait(lock, stop, [this] { return !wanted_.empty(); })) {
    const std::shared_ptr<Session> session = std::move(wanted_.front());
    wanted_.pop_front();
    lock.unlock();
    const auto loading = session->history().Load();
    lock.lock();
    if (loading != HistoryShelf::Loading::kNoMemory || stopped_) continue;
    wanted_.push_back(session);  // others may be smaller
    wanted_changed_.wait_for(lock, stop, kRetryLoading, [] { return false; });
  }
}

}  // namespace stellate::server
