#include "server/net/connection_guard.h"

#include <fcntl.h>
#include <linux/tcp.h>
#include <malloc.h>
#include <netinet/in.h>
#include <poll.h>
#include <sys/epoll.h>
#include <sys/eventfd.h>
#include <sys/ioctl.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <functional>
#include <string_view>
#include <utility>

#include "core/base/message.h"
#include "server/base/log.h"
#include "server/net/socket_number.h"

namespace stellate::server {
namespace {

using core::Message;

constexpr int kMostEvents = 1024;
constexpr int kLookMilliseconds = 20;      // between two looks: some hundred calls may come
constexpr int kHurryMilliseconds = 2;      // while much is unread: some megabytes may come
constexpr std::uint64_t kFewBytes = 4096;  // too little for many calls, 16 bytes each at least
constexpr std::size_t kFewCalls = 64;
constexpr std::uint64_t kHelloBytes = 33;  // HTTP/2's preface and an empty frame of settings
constexpr int kSilentMilliseconds = 250;   // between two looks at who has said hello
// Beyond the bound: whoever had so long and has not said hello makes room. A handshake takes two
// round trips and some milliseconds.
constexpr auto kHelloTime = std::chrono::seconds(1);
constexpr std::size_t kManySilent = 16;           // that leave without a hello leave memory behind
constexpr std::int64_t kLittle = 256 << 10;       // unread: a request or two, as most are
constexpr double kMoment = 0.01;                  // seconds that anybody may hold anything for
constexpr auto kAwake = std::chrono::seconds(1);  // after something came
constexpr auto kLogPause = std::chrono::seconds(1);
constexpr auto kQuiet = std::chrono::seconds(5);        // after a storm
constexpr auto kTidy = std::chrono::milliseconds(250);  // in one

std::uint64_t BytesReceived(int fd) {
  tcp_info info{};
  socklen_t size = sizeof(info);
  return getsockopt(fd, IPPROTO_TCP, TCP_INFO, &info, &size) == 0 ? info.tcpi_bytes_received : 0;
}

// Received, and not taken by gRPC yet.
std::uint64_t BytesWaiting(int fd) {
  int bytes = 0;
  return ioctl(fd, FIONREAD, &bytes) == 0 && bytes > 0 ? static_cast<std::uint64_t>(bytes) : 0;
}

}  // namespace

ConnectionGuard::ConnectionGuard(int port, const Limits& limits, CallJudge judge,
                                 std::function<void(const char* setting)> closed)
    : port_(port),
      limits_(limits),
      unread_(std::make_shared<UnreadRules>(std::move(judge), limits.unread_bytes * 2 / 3,
                                            limits.request_bytes + kLittle)),
      closed_(std::move(closed)),
      epoll_(epoll_create1(EPOLL_CLOEXEC)),
      wake_(eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK)) {
  epoll_event event{};  // of key 0, which no connection has
  event.events = EPOLLIN;
  epoll_ctl(epoll_, EPOLL_CTL_ADD, wake_, &event);
  thread_ = std::jthread([this](const std::stop_token& stop) { Run(stop); });
}

ConnectionGuard::~ConnectionGuard() {
  thread_.request_stop();
  Wake();
  thread_.join();
  close(epoll_);
  close(wake_);
}

void ConnectionGuard::Wake() const {
  const std::uint64_t one = 1;
  [[maybe_unused]] const auto written = write(wake_, &one, sizeof(one));
}

void ConnectionGuard::Watch(int fd) {
  Connection connection;
  connection.came = Clock::now();
  connection.fd = fd;
  connection.number = NumberOf(fd);
  connection.peer = PeerOf(fd);
  connection.unread = CountUnread(fd, unread_);
  NothingIsUnread(&connection.of_strangers);
  NothingIsUnread(&connection.of_owners);
  const std::lock_guard lock(mutex_);
  connections_.emplace(++last_key_, std::move(connection));
  silent_.insert(last_key_);
  state_.silent_count = silent_.size();
  if (state_.napping) Wake();
  // Once for all that came meanwhile. It ends when gRPC closes the descriptor.
  epoll_event event{};
  event.events = EPOLLIN | EPOLLRDHUP | EPOLLET;
  event.data.u64 = last_key_;
  epoll_ctl(epoll_, EPOLL_CTL_ADD, fd, &event);
}

void ConnectionGuard::Run(const std::stop_token& stop) {
  std::vector<epoll_event> events(kMostEvents);
  while (!stop.stop_requested()) {
    const bool idle = busy_.empty() && gone_.ids.empty() && !memory_.untidy &&
                      unread_->strangers.bytes + unread_->owners.bytes == 0 &&
                      Clock::now() > awake_until_;
    state_.napping = idle;  // first, or somebody who comes now is not looked at
    const int nap = state_.silent_count > 0 ? kSilentMilliseconds : -1;
    const int count = epoll_wait(epoll_, events.data(), kMostEvents, idle ? nap : 0);
    state_.napping = false;
    std::uint64_t woken = 0;
    [[maybe_unused]] const auto taken = read(wake_, &woken, sizeof(woken));
    if (count > 0) awake_until_ = Clock::now() + kAwake;
    {
      const std::lock_guard lock(mutex_);
      if (idle) NothingWasUnread();
      for (int i = 0; i < count; ++i) {
        const epoll_event& event = events[static_cast<std::size_t>(i)];
        const auto found = connections_.find(event.data.u64);
        if (found == connections_.end()) continue;  // it was woken
        busy_.insert(found->first);
        if ((event.events & (EPOLLRDHUP | EPOLLHUP | EPOLLERR)) != 0) found->second.ending = true;
      }
      hurried_ = false;  // first, as the other takes longer
      BoundUnread(&ConnectionUnread::strangers, &Connection::of_strangers);
      BoundUnread(&ConnectionUnread::owners, &Connection::of_owners);
      BoundHellos();
      Look();
    }
    CountLeftBehind();
    if (Clock::now() - said_.time >= kLogPause) SayWhatWasClosed();
    if (memory_.untidy && (Clock::now() > memory_.quiet_at ||
                           (hurried_ && Clock::now() > memory_.given_back + kTidy))) {
      GiveBack();
    }
    pollfd wake{wake_, POLLIN, 0};
    poll(&wake, 1, hurried_ ? kHurryMilliseconds : kLookMilliseconds);
  }
  SayWhatWasClosed();
}

void ConnectionGuard::Look() {
  const bool sweep = connections_.size() > 2 * gone_.swept + kMostEvents;
  if (sweep) {
    for (const auto& [key, connection] : connections_) busy_.insert(key);
  }
  FindIds(busy_);
  gone_.ending_calls = 0;
  for (auto key = busy_.begin(); key != busy_.end();) {
    const auto found = connections_.find(*key);
    Connection& connection = found->second;
    const bool open = NumberOf(connection.fd) == connection.number;
    const bool calm = !open || IsCalm(&connection);
    if (open && connection.closed) gone_.ending_calls += connection.calls;
    if (!open) {
      if (connection.closed && connection.id != 0) gone_.ids.push_back(connection.id);
      silent_.erase(found->first);
      connections_.erase(found);
    }
    key = calm ? busy_.erase(key) : std::next(key);
  }
  if (sweep) gone_.swept = connections_.size();
}

// Nothing can come of it before more bytes come.
bool ConnectionGuard::IsCalm(Connection* connection) {
  const std::uint64_t bytes = BytesReceived(connection->fd);
  if (connection->id == 0) return bytes < kFewBytes && !connection->ending;
  const bool waits = connection->ending || BytesWaiting(connection->fd) >= kFewBytes;
  if (!waits && connection->calls <= kFewCalls && bytes - connection->bytes < kFewBytes) {
    return true;
  }
  const auto calls = CallsHeld(connection->id);
  connection->bytes = bytes;
  connection->calls = calls.value_or(0);
  if (!calls) connection->id = 0;  // gRPC is about to close it, or it was another's of that name
  if (connection->calls > limits_.calls && !connection->closed) {
    Close(connection, "max-connection-streams",
          Message("had ", connection->calls,
                  " calls that were open or were reset faster than they end"),
          Message(limits_.calls, " with those that were reset"));
  }
  return calls && !waits && *calls <= kFewCalls;
}

void ConnectionGuard::FindIds(const std::set<std::uint64_t>& keys) {
  std::unordered_map<std::string_view, Connection*> unknown;
  for (const std::uint64_t key : keys) {
    Connection& connection = connections_.at(key);
    if (connection.id == 0) unknown.emplace(connection.peer, &connection);
  }
  if (unknown.empty()) return;
  ForEachConnection([&](std::string_view peer, ConnectionId id) {
    const auto found = unknown.find(peer);
    if (found != unknown.end() && CameToPort(port_, id)) found->second->id = id;
  });
}

// gRPC names a connection once the handshake is over.
void ConnectionGuard::BoundHellos() {
  const auto now = Clock::now();
  state_.silent_count = silent_.size();
  const bool crowded = silent_.size() >= limits_.hellos;
  if (!crowded && now < gone_.seen_silent + std::chrono::milliseconds(kSilentMilliseconds)) return;
  gone_.seen_silent = now;
  if (!silent_.empty()) FindIds(silent_);
  std::erase_if(silent_, [this](std::uint64_t key) {
    const Connection& connection = connections_.at(key);
    if (NumberOf(connection.fd) != connection.number) {  // given up by either side
      busy_.insert(key);
      ++gone_.silent;
      return true;
    }
    return connection.id != 0 && BytesReceived(connection.fd) >= kHelloBytes;
  });
  const std::size_t seen = silent_.size();
  for (auto key = silent_.begin(); crowded && key != silent_.end();) {
    Connection& connection = connections_.at(*key);
    if (now - connection.came < kHelloTime) break;
    Close(&connection, "max-connections", Message("was one of ", seen, " that had not said hello"),
          Message("as many as ", limits_.hellos));
    ++gone_.silent;
    busy_.insert(*key);
    key = silent_.erase(key);
  }
  state_.silent_count = silent_.size();
  if (gone_.silent < kManySilent) return;
  gone_.silent = 0;
  memory_.untidy = true;
  memory_.quiet_at = now + kQuiet;
}

void ConnectionGuard::CountLeftBehind() {
  std::size_t calls = gone_.ending_calls;
  std::erase_if(gone_.ids, [&calls](ConnectionId id) {
    const std::size_t left = CallsHeld(id).value_or(0);
    calls += left;
    return left == 0;
  });
  state_.behind = calls > limits_.calls / 4;
}

// Until now, while nobody looked.
void ConnectionGuard::NothingWasUnread() {
  for (auto& [key, connection] : connections_) {
    NothingIsUnread(&connection.of_strangers);
    NothingIsUnread(&connection.of_owners);
  }
}

void ConnectionGuard::NothingIsUnread(Holding* holding) {
  holding->moved = holding->light = Clock::now();
}

void ConnectionGuard::BoundUnread(Unread ConnectionUnread::*account, Holding Connection::*holding) {
  const auto now = Clock::now();
  std::int64_t total = 0;
  std::vector<std::pair<double, Connection*>> holders;
  for (auto& [key, connection] : connections_) {
    Holding& held = connection.*holding;
    const std::int64_t bytes = ((*connection.unread).*account).bytes;
    const std::uint64_t whole = ((*connection.unread).*account).whole;
    if (bytes == 0 || whole != held.whole) held.moved = now;
    if (bytes < kLittle) held.light = now;
    held.whole = whole;
    if (bytes == 0 || connection.closed) continue;
    if (now - held.moved > limits_.request_time) {
      Close(&connection, "request-seconds", "had sent a part of a request, and no whole one",
            Message(limits_.request_time.count(), " seconds for each"));
      continue;
    }
    total += bytes;
    // Of a connection that many share, messages become whole all the time.
    const std::chrono::duration<double> time = now - std::min(held.moved, held.light);
    holders.emplace_back(static_cast<double>(bytes) * std::max(time.count(), kMoment), &connection);
  }
  const std::int64_t most = limits_.unread_bytes / 2;  // more comes before the next look
  if (total > most / 2) {
    hurried_ = true;
    memory_.untidy = true;
    memory_.quiet_at = now + kQuiet;
  }
  if (total <= most) return;
  std::sort(holders.begin(), holders.end(), std::greater<>());
  for (const auto& [weight, connection] : holders) {
    if (total <= most) return;
    const std::int64_t bytes = ((*connection->unread).*account).bytes;
    total -= bytes;
    Close(connection, "max-unread-bytes", Message("held ", bytes, " bytes of unfinished requests"),
          Message("all connections ", limits_.unread_bytes));
  }
}

// What the calls had; without this the allocator keeps it.
void ConnectionGuard::GiveBack() {
  memory_.untidy = hurried_;
  malloc_trim(0);
  memory_.given_back = Clock::now();
}

// `what` it did, where the setting allows only `allowed`.
void ConnectionGuard::Close(Connection* connection, const char* setting, const std::string& what,
                            const std::string& allowed) {
  connection->closed = connection->ending = true;
  closed_(setting);  // first: the client is not to know of it before
  const int fd = fcntl(connection->fd, F_DUPFD_CLOEXEC, 0);  // stays the same from here on
  if (NumberOf(fd) == connection->number) {
    // Not shutdown(2): it would leave gRPC what has come already, megabytes of it.
    sockaddr nowhere{};
    nowhere.sa_family = AF_UNSPEC;
    (void)connect(fd, &nowhere, sizeof(nowhere));  // whatever it says, the file is closed
  }
  close(fd);
  const auto now = Clock::now();
  memory_.untidy = true;
  memory_.quiet_at = now + kQuiet;
  ++said_.count;
  said_.last =
      Message("the last, of ", connection->peer, ", ", what, "; --", setting, " allows ", allowed);
  if (now - said_.time >= kLogPause) SayWhatWasClosed();
}

// At most once a second; of what comes faster, the last is said when that is over.
void ConnectionGuard::SayWhatWasClosed() {
  if (said_.count == 0) return;
  Log(LogLevel::kWarning, {}, Message("closed ", said_.count, " connections; ", said_.last));
  said_.time = Clock::now();
  said_.count = 0;
}

}  // namespace stellate::server
