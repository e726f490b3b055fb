#include "server/net/listener.h"

#include <linux/tcp.h>
#include <netdb.h>
#include <netinet/in.h>
#include <poll.h>
#include <sys/eventfd.h>
#include <sys/resource.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstdint>

#include "core/base/message.h"
#include "server/base/log.h"
#include "server/net/socket_number.h"

namespace stellate::server {
namespace {

using core::Message;

constexpr std::size_t kOtherFiles = 256;  // the journal, metrics, certificates, what gRPC opens
constexpr int kPauseMilliseconds = 100;   // while there is no file left to accept with
constexpr int kLaterMilliseconds = 20;    // while connections are to wait

// How many connections there can be, when `wanted` are asked for.
std::size_t ConnectionsAllowed(std::size_t wanted) {
  rlimit limit{};
  if (getrlimit(RLIMIT_NOFILE, &limit) != 0) return wanted;
  const rlim_t needed = wanted + kOtherFiles;
  if (limit.rlim_cur < needed) {
    limit.rlim_cur = std::min(needed, limit.rlim_max);
    setrlimit(RLIMIT_NOFILE, &limit);
  }
  if (limit.rlim_cur >= needed) return wanted;
  const auto files = static_cast<std::size_t>(limit.rlim_cur);
  const std::size_t allowed = std::min(wanted, files - std::min(kOtherFiles, files / 2));
  if (allowed == wanted) return wanted;
  Log(LogLevel::kWarning, {},
      Message("--max-connections allows ", wanted, " connections, but this process may open ",
              files, " files: it serves ", allowed, " connections; raise `ulimit -n`"));
  return allowed;
}

int Bind(const addrinfo& address) {
  const int fd = socket(address.ai_family, SOCK_STREAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0);
  if (fd < 0) return -1;
  const int on = 1;
  setsockopt(fd, SOL_SOCKET, SO_REUSEADDR, &on, sizeof(on));
  setsockopt(fd, IPPROTO_TCP, TCP_NODELAY, &on, sizeof(on));  // accepted ones inherit it
  if (bind(fd, address.ai_addr, address.ai_addrlen) == 0 && listen(fd, SOMAXCONN) == 0) return fd;
  close(fd);
  return -1;
}

int PortOf(int fd) {
  sockaddr_storage address{};
  socklen_t size = sizeof(address);
  if (getsockname(fd, reinterpret_cast<sockaddr*>(&address), &size) != 0) return 0;
  return ntohs(address.ss_family == AF_INET6
                   ? reinterpret_cast<const sockaddr_in6*>(&address)->sin6_port
                   : reinterpret_cast<const sockaddr_in*>(&address)->sin_port);
}

// The client has gone before it was accepted.
bool HungUp(int fd) {
  pollfd state{fd, POLLRDHUP, 0};
  return poll(&state, 1, 0) > 0;
}

}  // namespace

core::Expected<std::unique_ptr<Listener>> Listener::Open(ListenAddress address,
                                                         std::size_t max_connections) {
  addrinfo hints{};
  hints.ai_flags = AI_PASSIVE;
  hints.ai_socktype = SOCK_STREAM;
  addrinfo* found = nullptr;
  std::vector<int> sockets;
  if (getaddrinfo(address.host.c_str(), nullptr, &hints, &found) == 0) {
    for (const addrinfo* at = found; at != nullptr; at = at->ai_next) {
      // One port for all, also where it is a free one.
      const in_port_t same = htons(static_cast<in_port_t>(address.port));
      if (at->ai_family == AF_INET6) {
        reinterpret_cast<sockaddr_in6*>(at->ai_addr)->sin6_port = same;
      } else if (at->ai_family == AF_INET) {
        reinterpret_cast<sockaddr_in*>(at->ai_addr)->sin_port = same;
      }
      const int fd = Bind(*at);
      if (fd < 0) continue;  // localhost may have an address that this machine lacks
      sockets.push_back(fd);
      address.port = PortOf(fd);
    }
    freeaddrinfo(found);
  }
  if (sockets.empty()) {
    return core::Refuse(core::StatusCode::kFailedPrecondition,
                        Message("cannot listen on ", address.Target(),
                                ": another program has it, or this machine does not; choose "
                                "another --listen"));
  }
  return std::unique_ptr<Listener>(
      new Listener(std::move(sockets), address.port, ConnectionsAllowed(max_connections)));
}

Listener::Listener(std::vector<int> sockets, int port, std::size_t max_connections)
    : sockets_(std::move(sockets)), port_(port), max_connections_(max_connections) {}

Listener::~Listener() {
  Stop();
  for (const int fd : sockets_) close(fd);
  if (wake_ >= 0) close(wake_);
}

void Listener::Start(Taker take, std::function<void()> refused, std::function<bool()> later) {
  take_ = std::move(take);
  refused_ = std::move(refused);
  later_ = std::move(later);
  wake_ = eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK);
  thread_ = std::jthread([this](const std::stop_token& stop) { Run(stop); });
}

void Listener::Stop() {
  if (!thread_.joinable()) return;
  thread_.request_stop();
  const std::uint64_t one = 1;
  [[maybe_unused]] const auto written = write(wake_, &one, sizeof(one));
  thread_.join();
}

void Listener::Run(const std::stop_token& stop) {
  std::vector<pollfd> watched;
  for (const int fd : sockets_) watched.push_back({fd, POLLIN, 0});
  watched.push_back({wake_, POLLIN, 0});
  while (!stop.stop_requested()) {
    if (poll(watched.data(), watched.size(), -1) < 0) continue;
    for (const int fd : sockets_) Accept(fd, stop);
  }
}

void Listener::Accept(int socket, const std::stop_token& stop) {
  while (!stop.stop_requested()) {
    if (later_()) return Pause(kLaterMilliseconds);
    const int fd = accept4(socket, nullptr, nullptr, SOCK_CLOEXEC | SOCK_NONBLOCK);
    if (fd < 0) {
      if (errno == EAGAIN || errno == EWOULDBLOCK) return;
      // No files, no memory: connections wait in the kernel. Else the client is gone already.
      if (errno == EMFILE || errno == ENFILE || errno == ENOBUFS || errno == ENOMEM) {
        return Pause(kPauseMilliseconds);
      }
      continue;
    }
    if (HungUp(fd)) {  // storms leave many, and what they said would all be answered
      close(fd);
    } else if (!IsFull()) {
      open_.emplace_back(fd, NumberOf(fd));
      take_(socket, fd);
    } else {
      close(fd);
      refused_();
    }
  }
}

bool Listener::IsFull() {
  if (open_.size() >= max_connections_) {
    std::erase_if(open_, [](const auto& one) { return NumberOf(one.first) != one.second; });
  }
  const bool full = open_.size() >= max_connections_;
  if (full && !was_full_) {
    Log(LogLevel::kWarning, {},
        Message("there are ", max_connections_,
                " connections, the most that "
                "--max-connections allows: further ones are closed"));
  }
  was_full_ = full;
  return full;
}

void Listener::Pause(int milliseconds) const {
  pollfd wake{wake_, POLLIN, 0};
  poll(&wake, 1, milliseconds);
}

}  // namespace stellate::server
