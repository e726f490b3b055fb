#pragma once

#include <sys/types.h>

#include <cstddef>
#include <functional>
#include <memory>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "core/status.h"
#include "server/config/listen_address.h"

namespace stellate::server {

// Accepts TCP connections for gRPC, up to a number of open ones. gRPC's own listener (1.51)
// stops for good when the process has once run out of files, which any stranger can bring about by
// opening connections; this one closes what is too much, and goes on.
class Listener {
 public:
  // Takes a connection over, and closes it in the end.
  using Taker = std::function<void(int listener_fd, int fd)>;

  // Binds every address that the host stands for; port 0 takes a free one. Raises the process's
  // soft limit of open files where that many connections need it; where the hard limit is lower, so
  // is the number of connections. `who_allows` them: who_allows.h.
  static core::Expected<std::unique_ptr<Listener>> Open(
      ListenAddress address, std::size_t max_connections,
      std::string who_allows = "--max-connections");
  ~Listener();

  int port() const { return port_; }
  std::size_t max_connections() const { return max_connections_; }

  // Accepts, on a thread of its own, all whose clients are still there. `refused` is called for
  // each connection that was one too many.
  // While `later` says so, connections wait in the kernel.
  void Start(
      Taker take, std::function<void()> refused,
      std::function<bool()> later = [] { return false; });
  // Nothing is handed over after this.
  void Stop();

 private:
  Listener(std::vector<int> sockets, int port, std::size_t max_connections, std::string who_allows);
  void Run(const std::stop_token& stop);
  void Accept(int socket, const std::stop_token& stop);
  bool IsFull();
  void Pause(int milliseconds) const;

  const std::vector<int> sockets_;
  const int port_;
  const std::size_t max_connections_;
  const std::string who_allows_;
  int wake_ = -1;  // readable once it is to stop
  Taker take_;
  std::function<void()> refused_;
  std::function<bool()> later_;
  // What was handed over: a socket, and its inode, which distinguishes a closed socket from another
  // that got the same descriptor.
  std::vector<std::pair<int, ino_t>> open_;
  bool was_full_ = false;
  std::jthread thread_;
};

}  // namespace stellate::server
