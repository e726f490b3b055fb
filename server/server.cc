#include "server/server.h"

#include <grpcpp/ext/proto_server_reflection_plugin.h>
#include <grpcpp/grpcpp.h>
#include <grpcpp/health_check_service_interface.h>
#include <grpcpp/resource_quota.h>
#include <grpcpp/server_builder.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/un.h>
#include <unistd.h>

#include <cerrno>
#include <condition_variable>
#include <cstring>
#include <mutex>
#include <thread>

#include "core/base/message.h"
#include "server/convert/error_map.h"
#include "server/grpc_parts/header_bound.h"
#include "server/net/connection_guard.h"
#include "server/net/listener.h"
#include "server/net/tls.h"
#include "server/rpc/rpcs.h"
#include "stellate/v1/stellate.grpc.pb.h"

namespace stellate::server {
namespace {

using core::Message;
using core::Status;
using core::StatusCode;

constexpr auto kTick = std::chrono::seconds(1);
constexpr auto kPoll = std::chrono::milliseconds(20);
constexpr auto kReturn = std::chrono::seconds(1);          // for a worker that lost its stream
constexpr auto kLastWords = std::chrono::seconds(2);       // for streams to send what they have
constexpr auto kLook = std::chrono::milliseconds(2);       // whether they have
constexpr auto kFarewell = std::chrono::milliseconds(20);  // for clients to take leave
constexpr auto kLastRound = std::chrono::seconds(5);       // for meshers to notice a cancel
// The health of the process alone: it holds while the server drains.
constexpr char kAlive[] = "alive";
constexpr int kReadBytes = 64 << 10;
constexpr int kMaxSyncThreads = 64;  // reflection alone uses them
// Beside the calls that a connection may have open: those that its client has reset, and that gRPC
// is not done with. 5 MB; a client that waits for anything has a few.
constexpr std::size_t kResetCalls = 256;

// gRPC would take over any socket file, a living server's too.
Status ClearUnixPath(const std::string& path) {
  struct stat info {};
  if (lstat(path.c_str(), &info) != 0) return Status::Ok();
  if (!S_ISSOCK(info.st_mode)) {
    return {StatusCode::kFailedPrecondition, Message("--listen is unix:", path,
                                                     " but a file that is no socket stands there: "
                                                     "choose another path")};
  }
  const int probe = socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0);
  sockaddr_un address{};
  address.sun_family = AF_UNIX;
  std::strncpy(address.sun_path, path.c_str(), sizeof(address.sun_path) - 1);
  const int result = connect(probe, reinterpret_cast<sockaddr*>(&address), sizeof(address));
  const bool refused = result != 0 && errno == ECONNREFUSED;
  close(probe);
  if (!refused) {
    return {StatusCode::kFailedPrecondition,
            Message("--listen is unix:", path,
                    " but another server listens there: stop it, or "
                    "choose another path")};
  }
  unlink(path.c_str());
  return Status::Ok();
}

int Milliseconds(double seconds) { return static_cast<int>(seconds * 1000); }

void SetUp(const Config& config, grpc::ServerBuilder* builder) {
  const int size = static_cast<int>(config.max_message_bytes);
  builder->SetMaxReceiveMessageSize(size);
  builder->SetMaxSendMessageSize(size);
  // gRPC inflates a message before it measures it: 4 MB of zeros, packed, would take gigabytes.
  for (const auto algorithm : {GRPC_COMPRESS_DEFLATE, GRPC_COMPRESS_GZIP}) {
    builder->SetCompressionAlgorithmSupportStatus(algorithm, false);
  }
  // A frozen client is found by pings; clients may ping as often as they like.
  builder->AddChannelArgument(GRPC_ARG_KEEPALIVE_TIME_MS, Milliseconds(config.keepalive_seconds));
  builder->AddChannelArgument(GRPC_ARG_KEEPALIVE_TIMEOUT_MS,
                              Milliseconds(config.keepalive_timeout_seconds));
  builder->AddChannelArgument(GRPC_ARG_KEEPALIVE_PERMIT_WITHOUT_CALLS, 1);
  builder->AddChannelArgument(GRPC_ARG_HTTP2_MAX_PINGS_WITHOUT_DATA, 0);
  builder->AddChannelArgument(GRPC_ARG_HTTP2_MAX_PING_STRIKES, 0);
  builder->AddChannelArgument(GRPC_ARG_SERVER_HANDSHAKE_TIMEOUT_MS,
                              Milliseconds(config.hello_seconds));
  builder->AddChannelArgument(GRPC_ARG_ENABLE_CHANNELZ, 1);  // the connection guard asks it
  builder->AddChannelArgument(GRPC_ARG_MAX_CONCURRENT_STREAMS,
                              static_cast<int>(config.max_connection_streams));
  builder->AddChannelArgument(GRPC_ARG_MAX_METADATA_SIZE, static_cast<int>(kMostMetadataBytes));
  // What is read at once is kept until the last of it was used: 4 MB, unless it is said.
  builder->AddChannelArgument(GRPC_ARG_TCP_MAX_READ_CHUNK_SIZE, kReadBytes);
  grpc::ResourceQuota quota("stellated");
  quota.SetMaxThreads(kMaxSyncThreads);
  // The worse way, as unread.h says.
  if (!CountsUnread()) quota.Resize(config.max_unread_bytes);
  builder->SetResourceQuota(quota);
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
      : service(config, ToStoreLimits(config), std::move(factory)), rpcs(&service) {}

  Status ListenForPrometheus() {
    if (service.config.metrics_listen.empty()) return Status::Ok();
    return service.metrics.Listen(service.config.metrics_listen,
                                  [this] { return service.store.All(); });
  }

  // Takes up the meshes of an earlier server.
  Status OpenJournal() {
    const Config& config = service.config;
    if (config.data_dir.empty()) return Status::Ok();
    const std::uint64_t share = config.owner_journal_bytes > 0
                                    ? config.owner_journal_bytes
                                    : DefaultOwnerBytes(config.data_dir, config.max_journal_bytes);
    auto journal = Journal::Open({config.data_dir, config.max_journal_bytes, share});
    if (!journal) return std::move(journal.error());
    service.journal = std::move(*journal);
    service.store.RecordIn([this] { return service.journal->NewMesh(); });
    for (SessionOptions& options : service.journal->TakeMeshes()) {
      Furnish(service, &options);
      service.store.Restore(std::move(options));
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
      auto opened = Listener::Open(*address, service.config.max_connections);
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
        ConnectionGuard::Limits{service.config.max_connection_streams + kResetCalls,
                                static_cast<std::int64_t>(service.config.max_unread_bytes),
                                static_cast<std::int64_t>(service.config.max_message_bytes),
                                std::chrono::duration<double>(service.config.request_seconds)},
        [this](const char* setting) { service.metrics.LimitReached(setting); });
    listener->Start(
        [this, acceptor = std::shared_ptr(std::move(acceptor))](int listener_fd, int fd) {
          grpc::experimental::ExternalConnectionAcceptor::NewConnectionParameters connection;
          connection.listener_fd = listener_fd;
          connection.fd = fd;
          guard->Watch(fd);
          acceptor->HandleNewConnection(&connection);
        },
        [this] { service.metrics.LimitReached("max-connections"); },
        [this] { return guard->IsBehind(); });
    return Status::Ok();
  }

  void StartTicking() {
    ticker = std::jthread([this](std::stop_token stop) {
      std::unique_lock lock(tick_mutex);
      while (!tick_wake.wait_for(lock, stop, kTick, [&stop] { return stop.stop_requested(); })) {
        const TimePoint now = Clock::now();
        tls->Reload();
        service.authenticator->Reload();  // before the streams ask it
        service.streams.Tick(now);
        service.store.Sweep(now);
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
    for (std::uint64_t i = 0; i < closed; ++i) service.metrics.LimitReached("header-bytes");
    Log(LogLevel::kWarning, {},
        Message("closed ", closed, " connections whose headers were longer than ", kMostHeaderBytes,
                " bytes or came in more than ", kMostHeaderFrames, " frames"));
  }

  ServerState service;
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
    grpc::EnableDefaultHealthCheckService(true);
    grpc::reflection::InitProtoReflectionServerBuilderPlugin();
  });

  auto tls = TlsFiles::Open(config);
  if (!tls) return tl::unexpected(std::move(tls.error()));
  auto authenticator = Authenticator::Create(config);
  if (!authenticator) return tl::unexpected(std::move(authenticator.error()));
  auto impl = std::make_unique<Impl>(WithDefaults(config), std::move(factory));
  impl->tls = std::move(*tls);
  impl->service.authenticator = std::move(*authenticator);
  status = impl->OpenJournal();
  if (!status.ok()) return tl::unexpected(std::move(status));
  status = impl->ListenForPrometheus();
  if (!status.ok()) return tl::unexpected(std::move(status));
  grpc::ServerBuilder builder;
  SetUp(config, &builder);
  status = impl->Listen(&address, impl->tls->Credentials(), &builder);
  if (!status.ok()) return tl::unexpected(std::move(status));
  for (const char* name : {v1::Stellate::service_full_name(), kAlive}) {
    impl->server->GetHealthCheckService()->SetServingStatus(name, true);
  }
  impl->StartTicking();
  return std::unique_ptr<Server>(new Server(std::move(impl), address.Target()));
}

int Server::metrics_port() const { return impl_->service.metrics.port(); }

void Server::ReloadFiles() {
  impl_->tls->Reload(/*force=*/true);
  impl_->service.authenticator->Reload(/*force=*/true);
}

bool Server::Stop(Clock::duration drain, const std::function<bool()>& hurry) {
  Impl& impl = *impl_;
  if (impl.stopped) return true;
  impl.stopped = true;
  ServerState& service = impl.service;
  for (const char* name : {"", v1::Stellate::service_full_name()}) {
    impl.server->GetHealthCheckService()->SetServingStatus(name, false);
  }
  service.draining = true;

  const TimePoint drained = Clock::now() + drain;
  const auto wait_while = [&](TimePoint until, const auto& busy) {
    while (busy() && Clock::now() < until && !hurry()) std::this_thread::sleep_for(kPoll);
  };
  // A mesh that nobody serves gets no further, however long it is waited for.
  TimePoint served = Clock::now();
  wait_while(drained, [&] {
    const TimePoint now = Clock::now();
    if (service.store.Served() > 0) served = now;
    return service.store.Running() > 0 && now - served < kReturn;
  });
  // Streams of finished meshes end by themselves, once read.
  if (service.store.Running() == 0) {
    wait_while(std::min(drained, Clock::now() + kLastWords),
               [&] { return service.streams.Count() > 0; });
  }
  service.streams.StopAll();
  if (impl.listener != nullptr) impl.listener->Stop();
  // gRPC also waits for clients that have no call open and do not look at their connection.
  const TimePoint said = Clock::now() + kLastWords;
  while (service.streams.Count() > 0 && Clock::now() < said) {
    std::this_thread::sleep_for(kLook);
  }
  impl.server->Shutdown(std::chrono::system_clock::now() + kFarewell);
  impl.server->Wait();
  impl.ticker.request_stop();
  impl.ticker.join();
  LogLeftOut();
  service.metrics.StopListening();
  return service.store.Stop(Clock::now() + kLastRound);
}

}  // namespace stellate::server
