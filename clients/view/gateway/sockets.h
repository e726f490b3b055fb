#pragma once

#include <cstddef>
#include <functional>
#include <list>
#include <unordered_map>
#include <utility>

namespace stellate::view {

// The connections that are open. Those that have not proved that they are our page are strangers,
// who take no room from those that have: the eldest of too many is ended. One thread alone.
class Sockets {
 public:
  // `leave` ends it, and calls Close.
  void Open(const void* socket, std::function<void()> leave) {
    open_[socket] = std::move(leave);
    strangers_.push_back(socket);
  }
  void Trust(const void* socket) { strangers_.remove(socket); }
  void Close(const void* socket) {
    strangers_.remove(socket);
    open_.erase(socket);
  }

  // For a stranger. False: there are as many pages as there may be.
  bool MakeRoom() {
    while (strangers_.size() >= kMostStrangers) End(strangers_.front());
    return open_.size() - strangers_.size() < kMostTrusted;
  }
  void EndAll() {
    while (!open_.empty()) End(open_.begin()->first);
  }

 private:
  static constexpr std::size_t kMostTrusted = 256, kMostStrangers = 64;

  void End(const void* socket) {
    const auto leave = open_.at(socket);
    leave();
    Close(socket);
  }

  std::unordered_map<const void*, std::function<void()>> open_;
  std::list<const void*> strangers_;  // the eldest first
};

}  // namespace stellate::view
