#include "server/server.h"

#include <grpc/grpc.h>
#include <grpcpp/ext/proto_server_reflection_plugin.h>
#include <grpcpp/grpcpp.h>
#include <grpcpp/health_check_service_interface.h>
#include <grpcpp/server_builder.h>
#include <sys/stat.h>

#include <condition_variable>
#include <mutex>
#include <string_view>
#include <thread>

#include "core/base/message.h"
#include "server/config/listen_address.h"
#include "server/drain.h"
#include "server/grpc_parts/header_bound.h"
#include "server/net/channel_arguments.h"
#include "server/net/connection_guard.h"
#include "server/net/listener.h"
#include "server/net/tls.h"
#include "server/net/unix_socket.h"
#include "server/rpc/service.h"
#include "stellate/v1/stellate.grpc.pb.h"

namespace stellate::server {
namespace {

using core::Message;
using core::Status;
using core::StatusCode;

constexpr auto kTick = std::chrono::seconds(1);
constexpr auto kLook = std::chrono::milliseconds(2);       // whether they have
constexpr auto kFarewell = std::chrono::milliseconds(20);  // for clients to take leave
constexpr auto kLastRound = std::chrono::seconds(5);       // for meshers to notice a cancel
// The health of the process alone: it holds while the server drains.
constexpr char kAlive[] = "alive";
// Beside the calls that a connection may have open: those that its client has reset, and that gRPC
// is not done with. 5 MB; a client that waits for anything has a few.
constexpr std::size_t kResetCalls = 256;

CallKind KindOf(const Authenticator& authenticator, std::string_view path,
                std::string_view authorization) {
  for (const std::string_view open : {"/grpc.health.", "/grpc.reflection."}) {
    if (path.substr(0, open.size()) == open) return CallKind::kSmall;
  }
  if (!Rpcs::Serves(path)) return CallKind::kRefused;
  if (!authenticator.AsksForTokens()) return CallKind::kAnybodys;
  return authenticator.Knows(authorization) ? CallKind::kOwners : CallKind::kRefused;
}

StoreLimits ToStoreLimits(const Config& config) {
  return {config.max_meshes, config.keep_finished_meshes,
          std::chrono::duration_cast<Clock::duration>(
              std::chrono::duration<double>(config.keep_finished_seconds)),
          config.owner_meshes};
}

}  // namespace

// Members are destroyed from the last to the first: the server before what its calls use.
class Server::Impl {
 public:
  Impl(const Config& config, Session::MesherFactory factory)
      : state(config, ToStoreLimits(config), std::move(factory)), rpcs(&state) {}

  Status ListenForPrometheus() {
    if (state.config.metrics_listen.empty()) return Status::Ok();
    return state.metrics.Listen(state.config.metrics_listen, [this] { return state.store.All(); });
  }

  // Takes up the meshes of an earlier server.
  Status OpenJournal() {
    const Config& config = state.config;
    if (config.data_dir.empty()) return Status::Ok();
    const std::uint64_t share = config.owner_journal_bytes > 0
                                    ? config.owner_journal_bytes
                                    : DefaultOwnerBytes(config.data_dir, config.max_journal_bytes);
    auto journal = Journal::Open({config.data_dir, config.max_journal_bytes, share});
    if (!journal) return std::move(journal.error());
    state.journal = std::move(*journal);
    state.store.RecordIn([this] { return state.journal->NewMesh(); });
    for (SessionOptions& options : state.journal->TakeMeshes()) {
      ApplyServerPolicy(state, &options);
      state.store.Restore(std::move(options));
    }
    return Status::Ok();
  }

  // On a unix socket gRPC listens itself: only the server's own user gets that far.
  Status Listen(ListenAddress* address, std::shared_ptr<grpc::ServerCredentials> credentials,
                grpc::ServerBuilder* builder) {
    std::unique_ptr<grpc::experimental::ExternalConnectionAcceptor> acceptor;
    int unix_port = 0;
    if (address->IsUnix()) {
      builder->AddListeningPort(address->Target(), std::move(credentials), &unix_port);
    } else {
      auto opened = Listener::Open(*address, state.config.max_connections);
      if (!opened) return std::move(opened.error());
      listener = std::move(*opened);
      address->port = listener->port();
      acceptor = builder->experimental().AddExternalConnectionAcceptor(
          grpc::ServerBuilder::experimental_type::ExternalConnectionType::FROM_FD,
          std::move(credentials));
    }
    builder->RegisterService(&rpcs);
    builder->RegisterCallbackGenericService(&unknown_rpcs);
    const mode_t mask = umask(0177);  // a unix socket is its owner's alone, from its first moment
    server = builder->BuildAndStart();
    umask(mask);
    if (server == nullptr || (address->IsUnix() && unix_port <= 0)) {
      return {StatusCode::kFailedPrecondition,
              Message("cannot listen on ", address->Target(), ": choose another --listen")};
    }
    if (listener == nullptr) return Status::Ok();
    guard = std::make_unique<ConnectionGuard>(
        address->port,
        ConnectionGuard::Limits{state.config.max_connection_streams + kResetCalls,
                                static_cast<std::int64_t>(state.config.max_unread_bytes),
                                static_cast<std::int64_t>(state.config.max_message_bytes),
                                std::chrono::duration<double>(state.config.request_seconds)},
        [authenticator = state.authenticator](std::string_view path,
                                              std::string_view authorization) {
          return KindOf(*authenticator, path, authorization);
        },
        [this](const char* setting) { state.metrics.LimitReached(setting); });
    listener->Start(
        [this, acceptor = std::shared_ptr(std::move(acceptor))](int listener_fd, int fd) {
          grpc::experimental::ExternalConnectionAcceptor::NewConnectionParameters connection;
          connection.listener_fd = listener_fd;
          connection.fd = fd;
          guard->Watch(fd);
          acceptor->HandleNewConnection(&connection);
        },
        [this] { state.metrics.LimitReached("max-connections"); },
        [this] { return guard->IsBehind(); });
    return Status::Ok();
  }

  void StartTicking() {
    ticker = std::jthread([this](std::stop_token stop) {
      std::unique_lock lock(tick_mutex);
      while (!tick_wake.wait_for(lock, stop, kTick, [&stop] { return stop.stop_requested(); })) {
        const TimePoint now = Clock::now();
        tls->Reload();
        state.authenticator->Reload();  // before the streams ask it
        state.streams.Tick(now);
        state.store.Sweep(now);
        CountHeaderBlocks();
        LogLeftOut();
      }
    });
  }

  // Of every server in this process, as nothing tells whose they were.
  void CountHeaderBlocks() {
    const std::uint64_t closed = EndlessHeaderBlocks() - header_blocks;
    if (closed == 0) return;
    header_blocks += closed;
    for (std::uint64_t i = 0; i < closed; ++i) state.metrics.LimitReached("header-bytes");
    Log(LogLevel::kWarning, {},
        Message("closed ", closed, " connections whose headers were longer than ", kMostHeaderBytes,
                " bytes or came in more than ", kMostHeaderFrames, " frames"));
  }

  ServerState state;
  Rpcs rpcs;
  UnknownRpcs unknown_rpcs;
  std::unique_ptr<TlsFiles> tls;
  std::unique_ptr<grpc::Server> server;
  std::unique_ptr<ConnectionGuard> guard;  // TCP alone, as the next
  std::unique_ptr<Listener> listener;
  bool stopped = false;
  std::uint64_t header_blocks = EndlessHeaderBlocks();  // that were counted
  std::mutex tick_mutex;
  std::condition_variable_any tick_wake;
  std::jthread ticker;
};

Server::Server(std::unique_ptr<Impl> impl, std::string address)
    : impl_(std::move(impl)), address_(std::move(address)) {}

Server::~Server() { Stop(Clock::duration::zero()); }

core::Expected<std::unique_ptr<Server>> Server::Start(const Config& config,
                                                      Session::MesherFactory factory) {
  Status status = Validate(config);
  if (!status.ok()) return tl::unexpected(std::move(status));
  ListenAddress address = *ParseListenAddress(config.listen);
  if (address.IsUnix()) {
    status = ClearUnixPath(address.unix_path);
    if (!status.ok()) return tl::unexpected(std::move(status));
  }
  static std::once_flag plugins;
  std::call_once(plugins, [] {
    if (!HeaderBlocksEnd()) {
      Log(LogLevel::kWarning, {},
          Message("gRPC ", grpc::Version(), " takes headers without end (CVE-2023-33953), which ",
                  "stops the server for everybody: let strangers reach it through a proxy alone"));
    }
    grpc_init();  // for good: its shutdown now and then waits for ten seconds
    grpc::EnableDefaultHealthCheckService(true);
    grpc::reflection::InitProtoReflectionServerBuilderPlugin();
  });

  auto tls = TlsFiles::Open(config);
  if (!tls) return tl::unexpected(std::move(tls.error()));
  auto authenticator = Authenticator::Create(config);
  if (!authenticator) return tl::unexpected(std::move(authenticator.error()));
  auto impl = std::make_unique<Impl>(WithDefaults(config), std::move(factory));
  impl->tls = std::move(*tls);
  impl->state.authenticator = std::move(*authenticator);
  status = impl->OpenJournal();
  if (!status.ok()) return tl::unexpected(std::move(status));
  status = impl->ListenForPrometheus();
  if (!status.ok()) return tl::unexpected(std::move(status));
  grpc::ServerBuilder builder;
  SetChannelArguments(config, &builder);
  status = impl->Listen(&address, impl->tls->Credentials(), &builder);
  if (!status.ok()) return tl::unexpected(std::move(status));
  for (const char* name : {v1::Stellate::service_full_name(), kAlive}) {
    impl->server->GetHealthCheckService()->SetServingStatus(name, true);
  }
  impl->StartTicking();
  return std::unique_ptr<Server>(new Server(std::move(impl), address.Target()));
}

int Server::metrics_port() const { return impl_->state.metrics.port(); }

void Server::ReloadFiles() {
  impl_->tls->Reload(/*force=*/true);
  impl_->state.authenticator->Reload(/*force=*/true);
}

bool Server::Stop(Clock::duration drain, const std::function<bool()>& hurry) {
  Impl& impl = *impl_;
  if (impl.stopped) return true;
  impl.stopped = true;
  ServerState& state = impl.state;
  for (const char* name : {"", v1::Stellate::service_full_name()}) {
    impl.server->GetHealthCheckService()->SetServingStatus(name, false);
  }
  state.draining = true;

  Drain(state, drain, hurry);
  state.streams.StopAll();
  if (impl.listener != nullptr) impl.listener->Stop();
  // gRPC also waits for clients that have no call open and do not look at their connection.
  const TimePoint said = Clock::now() + kLastWords;
  while (state.streams.Count() > 0 && Clock::now() < said) {
    std::this_thread::sleep_for(kLook);
  }
  impl.server->Shutdown(std::chrono::system_clock::now() + kFarewell);
  impl.server->Wait();
  impl.ticker.request_stop();
  impl.ticker.join();
  LogLeftOut();
  state.metrics.StopListening();
  return state.store.Stop(Clock::now() + kLastRound);
}

}  // namespace stellate::server
