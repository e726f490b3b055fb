#include "server/server.h"

#include <grpc/grpc.h>
#include <grpcpp/ext/proto_server_reflection_plugin.h>
#include <grpcpp/grpcpp.h>
#include <grpcpp/health_check_service_interface.h>
#include <grpcpp/server_builder.h>
#include <unistd.h>

#include <array>
#include <atomic>
#include <condition_variable>
#include <mutex>
#include <string_view>
#include <thread>

#include "core/base/message.h"
#include "server/base/log.h"
#include "server/base/version.h"
#include "server/config/listen_address.h"
#include "server/config/settings.h"
#include "server/drain.h"
#include "server/net/guarded_server.h"
#include "server/net/tls.h"
#include "server/otlp/span_exporter.h"
#include "server/otlp/span_settings.h"
#include "server/postgres/database.h"
#include "server/rpc/service.h"
#include "stellate/v1/stellate.grpc.pb.h"

namespace stellate::server {
namespace {

using core::Status;

constexpr auto kTick = std::chrono::seconds(1);
constexpr auto kLook = std::chrono::milliseconds(2);       // whether they have
constexpr auto kFarewell = std::chrono::milliseconds(20);  // for clients to take leave
constexpr auto kLastRound = std::chrono::seconds(5);       // for meshers to notice a cancel
constexpr auto kLastSpans = std::chrono::seconds(2);       // for the collector to take them
// The health of the process alone: it holds while the server drains.
constexpr char kAlive[] = "alive";

CallKind KindOf(const Authenticator& authenticator, std::string_view path,
                std::string_view authorization) {
  for (const std::string_view open : {"/grpc.health.", "/grpc.reflection."}) {
    if (path.substr(0, open.size()) == open) return CallKind::kSmall;
  }
  if (!Rpcs::Serves(path)) return CallKind::kRefused;
  if (!authenticator.AsksForTokens()) return CallKind::kAnybodys;
  return authenticator.Knows(authorization) ? CallKind::kOwners : CallKind::kRefused;
}

core::Expected<std::unique_ptr<Journal>> OpenDirectory(const Config& config) {
  const std::uint64_t share = config.owner_journal_bytes > 0
                                  ? config.owner_journal_bytes
                                  : DefaultOwnerBytes(config.data_dir, config.max_journal_bytes);
  return Journal::Open({config.data_dir, config.max_journal_bytes, share});
}

core::Expected<std::unique_ptr<Journal>> OpenRecords(const Config& config,
                                                     const std::function<void(bool)>& on_answer,
                                                     const std::function<bool()>& give_up) {
  const auto patience = std::chrono::duration_cast<Clock::duration>(
      std::chrono::duration<double>(config.database_patience_seconds));
  auto records =
      OpenDatabase({config.database, config.max_journal_bytes, patience, on_answer}, give_up);
  if (!records) return tl::unexpected(std::move(records.error()));
  const std::uint64_t share =
      config.owner_journal_bytes > 0 ? config.owner_journal_bytes : config.max_journal_bytes / 2;
  return Journal::Over(std::move(*records), {"", config.max_journal_bytes, share});
}

// What others dial of what a server listens on.
std::string AsPeersDial(const std::string& listening) {
  const auto address = ParseListenAddress(listening);
  std::array<char, 256> name{};
  if (!address || !address->IsEvery() || gethostname(name.data(), name.size() - 1) != 0) {
    return listening;
  }
  return core::Message(name.data(), ":", address->port);
}

}  // namespace

// Members are destroyed from the last to the first: the server before what its calls use.
class Server::Impl {
 public:
  Impl(const Config& config, Session::MesherFactory factory)
      : asked(config), state(WithDefaults(config), std::move(factory)), rpcs(&state) {}

  Status ListenForPrometheus() {
    const std::string& address = asked.metrics_listen;
    if (address.empty() || state.metrics.port() != 0) return Status::Ok();
    return state.metrics.Listen(
        address, [this] { return state.store.All(); },
        [this] { return is_listening ? state.WhyNoNewMeshes() : "it waits for its database"; });
  }

  // Where spans go, if anybody asks for them. What is wrong in the environment, which many programs
  // share, stops no server.
  Status StartSpans() {
    const auto found = FindSpanSettings(asked.traces_to, ReadEnvironment);
    if (!found && !asked.traces_to.empty()) return found.error();
    if (!found) {
      Log(LogLevel::kWarning, {}, "no spans of meshes are sent",
          LogFields().Add("why", found.error().message));
    }
    if (!found || !*found) return Status::Ok();
    exporter = std::make_shared<SpanExporter>(
        **found, Version(),
        SpanExporter::Counts{state.metrics.SpansSent(), state.metrics.SpansDropped()});
    state.spans = exporter;
    Log(LogLevel::kInfo, {}, "spans of meshes are sent",
        LogFields().Add("collector", (*found)->url.target));
    return Status::Ok();
  }

  // Takes up the meshes of an earlier server.
  Status OpenJournal(const std::function<bool()>& give_up) {
    if (!IsDurable(asked)) return Status::Ok();
    const auto on_answer = [this](bool yes) { state.metrics.DatabaseAnswers(yes); };
    auto journal =
        asked.database.empty() ? OpenDirectory(asked) : OpenRecords(asked, on_answer, give_up);
    if (!journal) return std::move(journal.error());
    state.journal = std::move(*journal);
    state.store.RecordIn([this] { return state.journal->NewMesh(); });
    for (SessionOptions& options : state.journal->TakeMeshes()) {
      ApplyServerPolicy(state, &options);
      state.store.Restore(std::move(options));
    }
    Share();
    return Status::Ok();
  }

  // Where other servers have records in the same database.
  void Share() {
    Sharing* const sharing = state.journal->sharing();
    if (sharing == nullptr) return;
    sharing->LimitOwners(asked.owner_meshes);
    state.authenticator->Trust({sharing->secret(), [sharing] { return sharing->number(); },
                                [sharing] { return sharing->beat(); }});
    state.router.Start(PeerCredentials(asked));
  }

  Status Listen() {
    grpc::ServerBuilder builder;
    builder.RegisterService(&rpcs);
    builder.RegisterCallbackGenericService(&unknown_rpcs);
    auto started = GuardedServer::Start(
        asked, &builder,
        {[authenticator = state.authenticator](std::string_view path,
                                               std::string_view authorization) {
           return KindOf(*authenticator, path, authorization);
         },
         [this](const char* setting) { state.metrics.LimitReached(setting); }});
    if (!started) return std::move(started.error());
    server = std::move(*started);
    state.router.Announce(asked.peer_address.empty() ? AsPeersDial(server->address())
                                                     : asked.peer_address);
    return Status::Ok();
  }

  void StartTicking() {
    ticker = std::jthread([this](std::stop_token stop) {
      std::unique_lock lock(tick_mutex);
      while (!tick_wake.wait_for(lock, stop, kTick, [&stop] { return stop.stop_requested(); })) {
        const TimePoint now = Clock::now();
        server->Tick();
        state.authenticator->Reload();  // before the streams ask it
        state.streams.Tick(now);
        state.store.Sweep(now);
        if (state.journal != nullptr) {
          state.metrics.DatabaseAnswers(!state.journal->IsAway());
          const Sharing* const sharing = state.journal->sharing();
          if (sharing != nullptr) state.metrics.Share(sharing->Peers().size());
        }
        LogLeftOut();
      }
    });
  }

  Config asked;  // as it was given, zeros that stand for something among it
  std::atomic<bool> is_listening{false};
  ServerState state;
  Rpcs rpcs;
  UnknownRpcs unknown_rpcs;
  std::shared_ptr<SpanExporter> exporter;  // null: nobody asks for spans
  std::unique_ptr<GuardedServer> server;
  bool stopped = false;
  std::mutex tick_mutex;
  std::condition_variable_any tick_wake;
  std::jthread ticker;
};

Server::Server(std::unique_ptr<Impl> impl, std::string address)
    : impl_(std::move(impl)), address_(std::move(address)) {}

Server::~Server() { Stop(Clock::duration::zero()); }

core::Expected<std::unique_ptr<Server>> Server::Start(const Config& config,
                                                      Session::MesherFactory factory,
                                                      const std::function<bool()>& give_up) {
  Status status = Validate(config);
  if (!status.ok()) return tl::unexpected(std::move(status));
  static std::once_flag plugins;
  std::call_once(plugins, [] {
    grpc_init();  // for good: its shutdown now and then waits for ten seconds
    grpc::EnableDefaultHealthCheckService(true);
    grpc::reflection::InitProtoReflectionServerBuilderPlugin();
  });

  auto authenticator = Authenticator::Create(config);
  if (!authenticator) return tl::unexpected(std::move(authenticator.error()));
  auto impl = std::make_unique<Impl>(config, std::move(factory));
  impl->state.authenticator = std::move(*authenticator);
  impl->state.turns->WeighBy([authenticator = impl->state.authenticator](const std::string& owner) {
    return authenticator->WeightOf(owner);
  });
  status = impl->StartSpans();
  if (!status.ok()) return tl::unexpected(std::move(status));
  // While this waits for the database.
  if (!config.database.empty()) impl->ListenForPrometheus();
  status = impl->OpenJournal(give_up);
  if (!status.ok()) return tl::unexpected(std::move(status));
  status = impl->ListenForPrometheus();
  if (!status.ok()) return tl::unexpected(std::move(status));
  status = impl->Listen();
  if (!status.ok()) return tl::unexpected(std::move(status));
  impl->is_listening = true;
  for (const char* name : {v1::Stellate::service_full_name(), kAlive}) {
    impl->server->grpc().GetHealthCheckService()->SetServingStatus(name, true);
  }
  impl->StartTicking();
  std::string address = impl->server->address();
  return std::unique_ptr<Server>(new Server(std::move(impl), std::move(address)));
}

int Server::metrics_port() const { return impl_->state.metrics.port(); }

void Server::ReloadFiles() {
  impl_->server->ReloadFiles();
  impl_->state.authenticator->Reload(/*force=*/true);
}

Status Server::Reload(const Config& next) {
  Status status = Validate(next);
  if (!status.ok()) return status;
  const Changes changes = TakeOver(next, &impl_->asked);
  impl_->state.Adopt(WithDefaults(impl_->asked));
  const auto& journal = impl_->state.journal;
  if (journal != nullptr && journal->sharing() != nullptr) {
    journal->sharing()->LimitOwners(impl_->asked.owner_meshes);
  }
  for (const std::string& change : changes.taken) {
    Log(LogLevel::kInfo, {}, "from now on " + change);
  }
  for (const std::string& key : changes.at_next_start) {
    Log(LogLevel::kWarning, {}, key + " was changed: that holds from the next start on");
  }
  return Status::Ok();
}

std::shared_ptr<const Config> Server::config() const { return impl_->state.config(); }

bool Server::Stop(Clock::duration drain, const std::function<bool()>& hurry) {
  Impl& impl = *impl_;
  if (impl.stopped) return true;
  impl.stopped = true;
  ServerState& state = impl.state;
  for (const char* name : {"", v1::Stellate::service_full_name()}) {
    impl.server->grpc().GetHealthCheckService()->SetServingStatus(name, false);
  }
  state.draining = true;

  Drain(state, drain, hurry);
  state.streams.StopAll();
  state.router.Refuse();
  impl.server->StopListening();
  // Streams end once what is on its way has been read; a client that does not read is cut off. gRPC
  // also waits for clients that have no call open and do not look at their connection.
  const TimePoint said = Clock::now() + kLastWords;
  while (state.streams.Count() > 0 && Clock::now() < said) {
    std::this_thread::sleep_for(kLook);
  }
  impl.server->grpc().Shutdown(std::chrono::system_clock::now() + kFarewell);
  impl.server->grpc().Wait();
  impl.ticker.request_stop();
  impl.ticker.join();
  LogLeftOut();
  state.metrics.StopListening();
  const bool clean = state.store.Stop(Clock::now() + kLastRound, [&state] {
    if (state.journal != nullptr) state.journal->StopWaiting();
  });
  state.router.Join();
  if (impl.exporter != nullptr) impl.exporter->Stop(kLastSpans);
  return clean;
}

}  // namespace stellate::server
