#include "tests/faults/relay.h"

#include <poll.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include <cerrno>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <utility>

namespace stellate::server::testing {
namespace {

sockaddr_un AddressOf(const std::string& path) {
  sockaddr_un address{};
  address.sun_family = AF_UNIX;
  std::strncpy(address.sun_path, path.c_str(), sizeof(address.sun_path) - 1);
  return address;
}

}  // namespace

Relay::Relay(std::string from, std::string to) : from_(std::move(from)), to_(std::move(to)) {
  listener_ = socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0);
  unlink(from_.c_str());
  const sockaddr_un address = AddressOf(from_);
  if (bind(listener_, reinterpret_cast<const sockaddr*>(&address), sizeof(address)) != 0 ||
      listen(listener_, 64) != 0) {
    std::perror("relay");
    std::abort();
  }
  thread_ = std::thread([this] { Carry(); });
}

Relay::~Relay() {
  stopping_ = true;
  thread_.join();
  Cut();
  close(listener_);
}

void Relay::Cut() {
  const std::lock_guard lock(mutex_);
  for (Pair& pair : pairs_) Close(&pair);
  pairs_.clear();
}

void Relay::Close(Pair* pair) {
  close(pair->client);
  close(pair->server);
}

void Relay::Accept() {
  Pair pair;
  pair.client = accept4(listener_, nullptr, nullptr, SOCK_CLOEXEC);
  if (pair.client < 0) return;
  pair.server = socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0);
  const sockaddr_un address = AddressOf(to_);
  if (connect(pair.server, reinterpret_cast<const sockaddr*>(&address), sizeof(address)) != 0) {
    return Close(&pair);
  }
  pairs_.push_back(pair);
}

bool Relay::Pass(int from, int to) {
  char buffer[1 << 16];
  const ssize_t size = recv(from, buffer, sizeof(buffer), MSG_DONTWAIT);
  if (size == 0) return false;
  if (size < 0) return errno == EAGAIN || errno == EINTR;
  for (ssize_t sent = 0; sent < size;) {
    const ssize_t more =
        send(to, buffer + sent, static_cast<std::size_t>(size - sent), MSG_NOSIGNAL);
    if (more <= 0) return false;
    sent += more;
  }
  return true;
}

void Relay::Carry() {
  while (!stopping_) {
    std::vector<pollfd> waiting{{listener_, POLLIN, 0}};
    {
      const std::lock_guard lock(mutex_);
      for (const Pair& pair : pairs_) {
        waiting.push_back({pair.client, POLLIN, 0});
        waiting.push_back({pair.server, POLLIN, 0});
      }
    }
    if (held_) {
      std::this_thread::sleep_for(std::chrono::milliseconds(2));
      continue;
    }
    poll(waiting.data(), waiting.size(), 10);
    const std::lock_guard lock(mutex_);
    if ((waiting[0].revents & POLLIN) != 0) Accept();
    std::erase_if(pairs_, [](Pair& pair) {
      if (Pass(pair.client, pair.server) && Pass(pair.server, pair.client)) return false;
      Close(&pair);
      return true;
    });
  }
}

}  // namespace stellate::server::testing
