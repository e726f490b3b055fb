#include "server/rpc/router.h"

#include <grpcpp/create_channel.h>
#include <grpcpp/support/channel_arguments.h>

#include <algorithm>
#include <atomic>
#include <charconv>
#include <utility>

#include "core/base/message.h"
#include "server/auth/ticket.h"
#include "server/base/log.h"
#include "server/rpc/server_state.h"

namespace stellate::server {
namespace {

using core::Message;

constexpr auto kBetweenTurns = std::chrono::milliseconds(250);
constexpr auto kTend = std::chrono::seconds(1);
// For which a call is kept while its mesh goes from one server to another: a server that died is
// missed for five seconds before another takes its meshes up.
constexpr auto kMoving = std::chrono::seconds(8);
constexpr std::size_t kPrefix = std::string_view("meshes/").size();
constexpr std::size_t kNumberDigits = 8;  // of a server's number in a name
constexpr std::uint64_t kNumbers = std::uint64_t{1} << (4 * kNumberDigits);
constexpr int kFirstPause = 100, kLongestPause = 1000;  // between connections, in milliseconds

// That the name was made with, if NewName made it.
std::uint64_t NumberIn(const std::string& mesh) {
  std::uint64_t number = 0;
  if (mesh.size() < kPrefix + kNumberDigits) return number;
  const char* const digits = mesh.data() + kPrefix;
  std::from_chars(digits, digits + kNumberDigits, number, 16);
  return number;
}

}  // namespace

struct Router::Line::Wire {
  std::shared_ptr<grpc::Channel> channel;
  std::atomic<std::size_t> calls{0};
};

Router::~Router() {
  Refuse();
  Join();
}

void Router::Start(std::shared_ptr<grpc::ChannelCredentials> credentials) {
  sharing_ = state_.journal == nullptr ? nullptr : state_.journal->sharing();
  if (sharing_ == nullptr) return;
  credentials_ = std::move(credentials);
  thread_ = std::jthread([this](const std::stop_token& stop) { Run(stop); });
}

void Router::Announce(const std::string& address) {
  if (sharing_ == nullptr) return;
  {
    const std::lock_guard lock(lines_mutex_);
    address_ = address;
  }
  sharing_->Announce(address);
}

void Router::Refuse() {
  std::list<std::shared_ptr<Asked>> asked;
  {
    const std::lock_guard lock(mutex_);
    refuses_ = true;
    asked.swap(asked_);
  }
  for (const auto& one : asked) one->then({Route::Kind::kNotNow, 0, nullptr});
}

void Router::Join() {
  if (!thread_.joinable()) return;
  thread_.request_stop();
  thread_.join();
}

bool Router::IsHere(const std::string& mesh) const {
  const auto session = state_.store.Find(mesh);
  return session != nullptr && !IsElsewhere(*session);
}

void Router::Find(const std::string& mesh, bool is_passed_on, Then then) {
  if (sharing_ == nullptr || !IsMeshName(mesh) || IsHere(mesh)) return then({});
  Ask([this, mesh, is_passed_on] { return Resolve(mesh, is_passed_on); }, std::move(then));
}

void Router::FindPage(const std::string& token, bool is_passed_on, Then then) {
  Route route = ResolvePage(token, is_passed_on);
  if (route.kind != Route::Kind::kNotNow) return then(std::move(route));
  Ask([this, token, is_passed_on] { return ResolvePage(token, is_passed_on); }, std::move(then));
}

void Router::Ask(std::function<Route()> resolve, Then then) {
  {
    const std::lock_guard lock(mutex_);
    if (!refuses_) {
      asked_.push_back(std::make_shared<Asked>(Asked{std::move(resolve), std::move(then)}));
      wake_.notify_one();
      return;
    }
  }
  then({Route::Kind::kNotNow, 0, nullptr});
}

std::shared_ptr<Router::Asked> Router::FirstDue() const {
  const auto due = [now = Clock::now()](const auto& asked) { return asked->next <= now; };
  const auto first = std::find_if(asked_.begin(), asked_.end(), due);
  return first == asked_.end() ? nullptr : *first;
}

void Router::Run(const std::stop_token& stop) {
  TimePoint tended;
  std::unique_lock lock(mutex_);
  while (!stop.stop_requested()) {
    wake_.wait_for(lock, stop, kBetweenTurns, [this] { return FirstDue() != nullptr; });
    if (refuses_) continue;
    const auto asked = FirstDue();
    lock.unlock();
    state_.store.YieldElsewhere();
    if (sharing_->IsTendingDue() || Clock::now() - tended > kTend) {
      Tend("");
      tended = Clock::now();
    }
    Route route;
    if (asked != nullptr) route = asked->resolve();
    lock.lock();
    const auto at = std::find(asked_.begin(), asked_.end(), asked);
    if (at == asked_.end()) continue;  // there was none, or Refuse has told it
    if (const TimePoint now = Clock::now();
        route.kind == Route::Kind::kNotNow && now - asked->since < kMoving) {
      asked->next = now + kBetweenTurns;
      asked_.splice(asked_.end(), asked_, at);  // others first
      continue;
    }
    asked_.erase(at);
    lock.unlock();
    asked->then(std::move(route));
    lock.lock();
  }
}

// Takes up meshes; empty: a share of those whose servers are gone.
void Router::Tend(const std::string& mesh) {
  auto taken = state_.journal->Tend(mesh);
  state_.store.YieldElsewhere();  // before what comes back under the same name
  for (SessionOptions& options : taken) {
    Log(LogLevel::kInfo, {options.request.name, 0, options.request.owner},
        "taken up from a server that is gone");
    ApplyServerPolicy(state_, &options);
    state_.store.Restore(std::move(options));
  }
  state_.metrics.TakenUp(taken.size());
}

Route Router::Resolve(const std::string& mesh, bool is_passed_on) {
  if (IsHere(mesh)) return {};
  Route not_now{Route::Kind::kNotNow, 0, nullptr};
  const auto found = state_.journal->Locate(mesh);
  if (!found) return not_now;
  if (found->exists && found->is_gone) {
    Tend(mesh);
    return IsHere(mesh) ? Route{} : not_now;
  }
  Peer peer{found->server, 0, found->address};
  if (!found->exists) {
    if (is_passed_on) return {};
    for (const Peer& one : sharing_->Peers()) {
      if (static_cast<std::uint64_t>(one.number) % kNumbers == NumberIn(mesh)) peer = one;
    }
    if (peer.number == 0) return {};
  }
  if (peer.number == sharing_->number()) return {};
  if (is_passed_on) return not_now;
  return To(peer);
}

// One that has no address yet will have one in a moment; one that has this server's was its
// predecessor, and is gone soon.
Route Router::To(const Peer& peer) const {
  const std::shared_ptr<const Config> config = state_.config();
  const std::size_t most = std::max<std::size_t>(1, config->max_connection_streams / 2);
  const std::lock_guard lock(lines_mutex_);
  if (peer.address.empty() || peer.address == address_) return {Route::Kind::kNotNow, 0, nullptr};
  std::erase_if(lines_, [peers = sharing_->Peers()](const auto& line) {
    return std::none_of(peers.begin(), peers.end(),
                        [&](const Peer& one) { return one.number == line.first; });
  });
  Line& line = lines_[peer.number];
  if (line.address != peer.address) line = {peer.address, {}};
  std::shared_ptr<Line::Wire> wire;
  for (const auto& one : line.wires) {
    if (one->calls < most) wire = one;
  }
  if (wire == nullptr) {
    grpc::ChannelArguments arguments;
    arguments.SetMaxReceiveMessageSize(static_cast<int>(config->max_message_bytes));
    arguments.SetMaxSendMessageSize(static_cast<int>(config->max_message_bytes));
    arguments.SetInt(GRPC_ARG_USE_LOCAL_SUBCHANNEL_POOL, 1);
    arguments.SetInt(GRPC_ARG_ENABLE_HTTP_PROXY, 0);
    arguments.SetInt(GRPC_ARG_INITIAL_RECONNECT_BACKOFF_MS, kFirstPause);
    arguments.SetInt(GRPC_ARG_MIN_RECONNECT_BACKOFF_MS, kLongestPause);
    arguments.SetInt(GRPC_ARG_MAX_RECONNECT_BACKOFF_MS, kLongestPause);
    const auto milliseconds = [](double seconds) { return static_cast<int>(1000 * seconds); };
    arguments.SetInt(GRPC_ARG_KEEPALIVE_TIME_MS, milliseconds(config->keepalive_seconds));
    arguments.SetInt(GRPC_ARG_KEEPALIVE_TIMEOUT_MS,
                     milliseconds(config->keepalive_timeout_seconds));
    arguments.SetInt(GRPC_ARG_HTTP2_MAX_PINGS_WITHOUT_DATA, 0);
    wire = std::make_shared<Line::Wire>();
    wire->channel = grpc::CreateCustomChannel(peer.address, credentials_, arguments);
    line.wires.push_back(wire);
  }
  ++wire->calls;
  state_.metrics.PassedOn();
  return {Route::Kind::kThere, peer.number,
          std::shared_ptr<grpc::Channel>(wire->channel.get(),
                                         [wire](grpc::Channel*) { --wire->calls; })};
}

Router::PageToken Router::ReadPageToken(const std::string& token) {
  PageToken read;
  const std::size_t dot = token.find('.');
  if (dot == std::string::npos) return {0, token};
  const auto [end, error] = std::from_chars(token.data(), token.data() + dot, read.server);
  if (error != std::errc() || end != token.data() + dot) return {0, token};
  read.rest = token.substr(dot + 1);
  return read;
}

std::int64_t Router::number() const { return sharing_ == nullptr ? 0 : sharing_->number(); }

std::int64_t Router::NumberAfter(std::int64_t number) const {
  if (sharing_ == nullptr) return 0;
  for (const Peer& peer : sharing_->Peers()) {
    if (peer.number > number && peer.address != kUnlisted) return peer.number;
  }
  return 0;
}

std::int64_t Router::BeatOf(std::int64_t number) const {
  for (const Peer& peer : sharing_->Peers()) {
    if (peer.number == number) return peer.beat;
  }
  return 0;
}

Route Router::ResolvePage(const std::string& token, bool is_passed_on) const {
  if (sharing_ == nullptr || is_passed_on) return {};
  const std::int64_t turn = NumberAfter(ReadPageToken(token).server - 1);
  if (turn == 0 || turn == sharing_->number()) return {};
  for (const Peer& peer : sharing_->Peers()) {
    if (peer.number == turn) return To(peer);
  }
  return {Route::Kind::kNotNow, 0, nullptr};
}

void Router::Introduce(const Route& route, const Identity& caller, const std::string& address,
                       const grpc::ServerContextBase& call, grpc::ClientContext* passed_on) const {
  passed_on->AddMetadata("authorization", Sign({route.server, BeatOf(route.server), caller.owner,
                                                caller.administrator, address},
                                               sharing_->secret()));
  const TraceHeaders& trace = caller.trace;
  if (!trace.parent.empty()) passed_on->AddMetadata(kTraceParent, trace.parent);
  if (!trace.state.empty()) passed_on->AddMetadata(kTraceState, trace.state);
  passed_on->set_deadline(call.deadline());
}

std::string Router::NewName() const {
  if (sharing_ == nullptr) return "";
  static constexpr char kHex[] = "0123456789abcdef";
  std::string name = NewMeshName();
  std::uint64_t number = static_cast<std::uint64_t>(sharing_->number()) % kNumbers;
  for (std::size_t digit = kNumberDigits; digit-- > 0; number /= 16) {
    name[kPrefix + digit] = kHex[number % 16];
  }
  return name;
}

}  // namespace stellate::server
