#include "server/grpc_parts/unread.h"

#include <mutex>
#include <unordered_map>
#include <utility>

namespace stellate::server {
namespace {

// Whose connection has a descriptor. The last to have it stays: descriptors are few.
class Connections {
 public:
  std::shared_ptr<ConnectionUnread> Add(int fd, std::shared_ptr<UnreadRules> rules) {
    auto unread = std::make_shared<ConnectionUnread>(std::move(rules));
    const std::lock_guard lock(mutex_);
    connections_[fd] = unread;
    return unread;
  }

  std::shared_ptr<ConnectionUnread> Find(int fd) {
    const std::lock_guard lock(mutex_);
    const auto found = connections_.find(fd);
    return found == connections_.end() ? nullptr : found->second;
  }

 private:
  std::mutex mutex_;
  std::unordered_map<int, std::shared_ptr<ConnectionUnread>> connections_;
};

// Outlives every connection.
Connections& AllConnections() {
  static auto& connections = *new Connections;
  return connections;
}

}  // namespace

std::shared_ptr<ConnectionUnread> CountUnread(int fd, std::shared_ptr<UnreadRules> rules) {
  return AllConnections().Add(fd, std::move(rules));
}

std::shared_ptr<ConnectionUnread> UnreadOf(int fd) { return AllConnections().Find(fd); }

}  // namespace stellate::server
