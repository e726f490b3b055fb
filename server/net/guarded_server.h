#pragma once

#include <grpcpp/grpcpp.h>

#include <cstdint>
#include <functional>
#include <memory>
#include <string>

#include "core/status.h"
#include "server/config/config.h"
#include "server/config/listen_address.h"
#include "server/grpc_parts/unread.h"
#include "server/net/connection_guard.h"
#include "server/net/listener.h"
#include "server/net/tls.h"

namespace stellate::server {

// A gRPC server that strangers may reach: our own listener, TLS, and the bounds on what connections
// hold. Every gRPC service of this project uses it.
class GuardedServer {
 public:
  struct Hooks {
    CallJudge judge;  // unread.h
    // A connection was refused or closed by a setting. From any thread.
    std::function<void(const char* setting)> limit_reached;
  };

  // Starts to listen. `builder` has the services. Uses the address, the files of TLS, and the
  // limits of connections and messages from `config`, which must be valid. kInvalidArgument: a file
  // of TLS; kFailedPrecondition: the address is not available.
  static core::Expected<std::unique_ptr<GuardedServer>> Start(const Config& config,
                                                              grpc::ServerBuilder* builder,
                                                              Hooks hooks);

  // What clients dial: "127.0.0.1:7717", "unix:/path".
  const std::string& address() const { return address_; }
  grpc::Server& grpc() { return *server_; }

  // Reads changed files of TLS, and reports closed connections to the hooks. Call it about once a
  // second.
  void Tick();
  void ReloadFiles() { tls_->Reload(/*force=*/true); }
  // Takes no further connection.
  void StopListening();

 private:
  explicit GuardedServer(Hooks hooks);
  core::Status Listen(const Config& config, ListenAddress* address, grpc::ServerBuilder* builder);
  void Guard(const Config& config, int port,
             std::shared_ptr<grpc::experimental::ExternalConnectionAcceptor> acceptor);

  const Hooks hooks_;
  std::string address_;
  // The order matters: members are destroyed from the last to the first.
  std::unique_ptr<TlsFiles> tls_;
  std::unique_ptr<grpc::Server> server_;
  std::unique_ptr<ConnectionGuard> guard_;  // for TCP only, as the listener
  std::unique_ptr<Listener> listener_;
  std::uint64_t header_blocks_;  // that were counted
};

}  // namespace stellate::server
