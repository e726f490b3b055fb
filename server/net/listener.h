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
// stops for good once the process has run out of files, which any stranger can cause by opening
// connections; this one closes the connections beyond the limit, and goes on.
class Listener {
 public:
  // Takes ownership of a connection.
  using Taker = std::function<void(int listener_fd, int fd)>;

  // Binds every address of the host; port 0 takes a free one. Raises the process's soft limit of
  // open files if that many connections need it; a lower hard limit lowers the number of
  // connections.
  static core::Expected<std::unique_ptr<Listener>> Open(ListenAddress address,
                                                        std::size_t max_connections);
  ~Listener();

  int port() const { return port_; }
  std::size_t max_connections() const { return max_connections_; }

  // Accepts connections on a thread of its own. `refused` is called for each connection beyond the
  // limit. While `later` returns true, connections wait in the kernel.
  void Start(
      Taker take, std::function<void()> refused,
      std::function<bool()> later = [] { return false; });
  // No connection is handed over after this.
  void Stop();

 private:
  Listener(std::vector<int> sockets, int port, std::size_t max_connections);
  void Run(const std::stop_token& stop);
  void Accept(int socket, const std::stop_token& stop);
  bool IsFull();
  void Pause(int milliseconds) const;

  const std::vector<int> sockets_;
  const int port_;
  const std::size_t max_connections_;
  int wake_ = -1;  // readable when the thread must stop
  Taker take_;
  std::function<void()> refused_;
  std::function<bool()> later_;
  // Connections that were handed over: a socket, and its inode, which distinguishes a closed socket
  // from another that got the same descriptor.
  std::vector<std::pair<int, ino_t>> open_;
  bool was_full_ = false;
  std::jthread thread_;
};

}  // namespace stellate::server
