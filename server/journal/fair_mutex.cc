#include "server/journal/fair_mutex.h"

namespace stellate::server {

void FairMutex::Lock(Place place) {
  std::unique_lock lock(mutex_);
  if (!taken_) {
    taken_ = true;
    return;
  }
  Waiter self;
  (place == Place::kFirst ? hurried_ : others_).push_back(&self);
  self.called.wait(lock, [&self] { return self.turn; });
}

void FairMutex::Unlock() {
  const std::lock_guard lock(mutex_);
  std::deque<Waiter*>& queue = hurried_.empty() ? others_ : hurried_;
  if (queue.empty()) {
    taken_ = false;
    return;
  }
  Waiter* const next = queue.front();
  queue.pop_front();
  next->turn = true;
  next->called.notify_one();  // under the lock: once it has its turn it may be gone
}

std::size_t FairMutex::waiting() const {
  const std::lock_guard lock(mutex_);
  return hurried_.size() + others_.size();
}

}  // namespace stellate::server
