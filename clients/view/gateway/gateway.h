#pragma once

#include <cstdint>
#include <memory>
#include <stop_token>
#include <string>

#include "stellate/connection.h"
#include "stellate/error.h"

namespace stellate::view {

struct GatewayOptions {
  Connection connection;
  std::string title;       // of the server, for people; empty: its address
  std::string mesh;        // shown first; empty: the newest
  std::uint16_t port = 0;  // on the loopback; 0: any that is free
  bool demo = false;       // the page goes on to each new mesh
};

// Serves the viewer's page to a browser on this machine, and passes the page's calls on to a server
// of meshes, undecoded. Listens on 127.0.0.1 alone; answers only requests whose Host is that
// address, calls only from the page itself (Origin), and only after each side has proved to the
// other that it knows the session's secret, which is in the address after "#" and never travels.
class Gateway {
 public:
  // kRefused: the port is taken, or this build has no page.
  static Expected<std::unique_ptr<Gateway>> Listen(GatewayOptions options);
  ~Gateway();

  // To be opened in a browser, any number of times.
  std::string Address() const;
  // The same for once only: what is given to a program can be seen in the list of processes.
  std::string AddressForOnce();

  // Until stop is requested.
  void Run(const std::stop_token& stop);

 private:
  class Impl;
  explicit Gateway(std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl_;
};

}  // namespace stellate::view
