#include "server/net/guarded_server.h"

#include <grpc/grpc.h>
#include <sys/stat.h>

#include <algorithm>
#include <chrono>
#include <mutex>
#include <utility>

#include "core/base/message.h"
#include "server/base/log.h"
#include "server/grpc_parts/header_bound.h"
#include "server/net/channel_arguments.h"
#include "server/net/unix_socket.h"

namespace stellate::server {
namespace {

using core::Message;
using core::Status;
using core::StatusCode;

// Beside the calls that a connection may have open: those that its client has reset, and that gRPC
// is not done with. 5 MB; a client that waits for anything has a few.
constexpr std::size_t kResetCalls = 256;
// Connections that may have said no hello, where --max-connections is small.
constexpr std::size_t kFewestHellos = 16;

void WarnOnceOfHeaders() {
  static std::once_flag once;
  std::call_once(once, [] {
    if (HeaderBlocksEnd()) return;
    Log(LogLevel::kWarning, {},
        Message("gRPC ", grpc::Version(), " takes headers without end (CVE-2023-33953), which ",
                "stops the server for all clients: let strangers reach it through a proxy alone"));
  });
}

}  // namespace

GuardedServer::GuardedServer(Hooks hooks)
    : hooks_(std::move(hooks)), header_blocks_(EndlessHeaderBlocks()) {}

core::Expected<std::unique_ptr<GuardedServer>> GuardedServer::Start(const Config& config,
                                                                    grpc::ServerBuilder* builder,
                                                                    Hooks hooks) {
  auto address = ParseListenAddress(config.listen);
  if (!address) return tl::unexpected(std::move(address.error()));
  if (address->IsUnix()) {
    Status status = ClearUnixPath(address->unix_path);
    if (!status.ok()) return tl::unexpected(std::move(status));
  }
  WarnOnceOfHeaders();
  auto tls = TlsFiles::Open(config);
  if (!tls) return tl::unexpected(std::move(tls.error()));
  std::unique_ptr<GuardedServer> guarded(new GuardedServer(std::move(hooks)));
  guarded->tls_ = std::move(*tls);
  SetChannelArguments(config, builder);
  Status status = guarded->Listen(config, &*address, builder);
  if (!status.ok()) return tl::unexpected(std::move(status));
  guarded->address_ = address->Target();
  return guarded;
}

// On a unix socket gRPC listens itself: only the server's own user gets that far.
Status GuardedServer::Listen(const Config& config, ListenAddress* address,
                             grpc::ServerBuilder* builder) {
  std::shared_ptr<grpc::experimental::ExternalConnectionAcceptor> acceptor;
  int unix_port = 0;
  if (address->IsUnix()) {
    builder->AddListeningPort(address->Target(), tls_->Credentials(), &unix_port);
  } else {
    auto opened = Listener::Open(*address, config.max_connections);
    if (!opened) return std::move(opened.error());
    listener_ = std::move(*opened);
    address->port = listener_->port();
    acceptor = builder->experimental().AddExternalConnectionAcceptor(
        grpc::ServerBuilder::experimental_type::ExternalConnectionType::FROM_FD,
        tls_->Credentials());
  }
  const mode_t mask = umask(0177);  // a unix socket is its owner's alone, from its first moment
  server_ = builder->BuildAndStart();
  umask(mask);
  if (server_ == nullptr || (address->IsUnix() && unix_port <= 0)) {
    return {StatusCode::kFailedPrecondition,
            Message("cannot listen on ", address->Target(), ": choose another --listen")};
  }
  if (listener_ != nullptr) Guard(config, address->port, std::move(acceptor));
  return Status::Ok();
}

void GuardedServer::Guard(
    const Config& config, int port,
    std::shared_ptr<grpc::experimental::ExternalConnectionAcceptor> acceptor) {
  guard_ = std::make_unique<ConnectionGuard>(
      port,
      ConnectionGuard::Limits{
          config.max_connection_streams + kResetCalls,
          static_cast<std::int64_t>(config.max_unread_bytes),
          static_cast<std::int64_t>(config.max_message_bytes),
          std::chrono::duration<double>(config.request_seconds),
          std::max(kFewestHellos, static_cast<std::size_t>(config.max_connections) / 8)},
      hooks_.judge, hooks_.limit_reached);
  listener_->Start(
      [this, acceptor = std::move(acceptor)](int listener_fd, int fd) {
        grpc::experimental::ExternalConnectionAcceptor::NewConnectionParameters connection;
        connection.listener_fd = listener_fd;
        connection.fd = fd;
        guard_->Watch(fd);
        acceptor->HandleNewConnection(&connection);
      },
      [this] { hooks_.limit_reached("max-connections"); }, [this] { return guard_->IsBehind(); });
}

void GuardedServer::Tick() {
  tls_->Reload();
  // Of every server in this process, as nothing tells whose they were.
  const std::uint64_t closed = EndlessHeaderBlocks() - header_blocks_;
  if (closed == 0) return;
  header_blocks_ += closed;
  for (std::uint64_t i = 0; i < closed; ++i) hooks_.limit_reached("header-bytes");
  Log(LogLevel::kWarning, {},
      Message("closed ", closed, " connections whose headers were longer than ", kMostHeaderBytes,
              " bytes or came in more than ", kMostHeaderFrames, " frames"));
}

void GuardedServer::StopListening() {
  if (listener_ != nullptr) listener_->Stop();
}

}  // namespace stellate::server
