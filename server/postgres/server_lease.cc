#include "server/postgres/server_lease.h"

#include <sys/random.h>

#include <array>
#include <condition_variable>
#include <optional>
#include <utility>

#include "core/base/message.h"
#include "server/base/log.h"
#include "server/postgres/schema.h"
#include "server/records/journal_format.h"

namespace stellate::server {
namespace {

using core::Message;
using core::StatusCode;
using Outcome = Connection::Outcome;

constexpr auto kBetween = std::chrono::milliseconds(250);  // between two looks at the others
// Of looks: what was longer under way was held up, and others' beats may have been as well.
constexpr auto kLongestGap = std::chrono::seconds(1);
constexpr auto kSilence = 3 * kBeat;  // of a database, until it counts as away

constexpr char kCommon[] =
    "UPDATE stellate.common SET secret = CASE WHEN secret = '' THEN $1 ELSE secret END, "
    "format = CASE WHEN EXISTS (SELECT FROM stellate.records) THEN format ELSE $2 END "
    "RETURNING format, secret";
constexpr char kEnter[] =
    "INSERT INTO stellate.servers (address, beats) VALUES ('', 0) RETURNING id";
constexpr char kBeatOnce[] =
    "UPDATE stellate.servers SET beats = beats + 1, address = $2 WHERE id = $1 RETURNING beats";
constexpr char kLookAround[] =
    "SELECT id, beats, address, EXISTS (SELECT FROM stellate.meshes AS m WHERE NOT EXISTS "
    "(SELECT FROM stellate.servers AS s WHERE s.id = m.server)) FROM stellate.servers";
constexpr char kDeclareGone[] =
    "DELETE FROM stellate.servers WHERE id = $1 AND beats = $2 RETURNING id";
constexpr char kLeave[] = "DELETE FROM stellate.servers WHERE id = $1 RETURNING id";

core::Expected<std::unique_ptr<Connection>> OpenTables(const std::string& url) {
  auto opened = Connection::Open(url);
  if (!opened) {
    return core::Refuse(
        StatusCode::kFailedPrecondition,
        Message("the database of --database cannot be opened: ", opened.error().message));
  }
  core::Status status = PrepareSchema(opened->get());
  if (!status.ok()) return tl::unexpected(std::move(status));
  return opened;
}

// The first connection, and the tables: waits for a database that is not there yet.
core::Expected<std::unique_ptr<Connection>> OpenPatiently(const std::string& url,
                                                          const ServerLease::Options& options,
                                                          const std::function<bool()>& give_up) {
  const auto note = [&options](bool answers) {
    if (options.on_answer) options.on_answer(answers);
  };
  const TimePoint began = Clock::now();
  auto opened = OpenTables(url);
  for (bool has_said = false; !opened; opened = OpenTables(url)) {
    if (!Connection::IsAway(url)) return opened;
    note(false);
    const std::chrono::duration<double> waited = Clock::now() - began, most = options.patience;
    if (waited >= most) {
      return core::Refuse(
          StatusCode::kFailedPrecondition,
          Message("the database of --database has not answered for ", waited.count(),
                  " seconds (--database-patience): ", opened.error().message));
    }
    if (!std::exchange(has_said, true)) {
      Log(LogLevel::kError, {},
          Message("waiting for the database, up to ", most.count(),
                  " seconds: ", opened.error().message));
    }
    std::this_thread::sleep_for(kBetween);
    if (give_up()) {
      return core::Refuse(StatusCode::kCancelled, "stopped while the database was away");
    }
  }
  note(true);
  return opened;
}

std::string NewSecret() {
  std::array<char, 32> bytes{};
  const bool whole = getrandom(bytes.data(), bytes.size(), 0) == static_cast<ssize_t>(bytes.size());
  return whole ? std::string(bytes.data(), bytes.size()) : "";
}

core::Status CannotWrite(const Connection& connection) {
  return {StatusCode::kFailedPrecondition,
          Message("the database of --database cannot be written: ", connection.error())};
}

// What all servers have in common; or they read another version of records.
core::Expected<std::string> JoinOthers(Connection* connection) {
  const std::atomic<bool> never{false};
  const std::string secret = NewSecret();
  if (secret.empty()) {
    return core::Refuse(StatusCode::kFailedPrecondition, "the system gives no random bytes");
  }
  Rows common;
  const auto parameters = Parameters().AddBytes(secret).Add(std::int64_t{kJournalVersion});
  if (connection->Run(kCommon, parameters, &common, never) != Outcome::kDone ||
      common.count() != 1) {
    return tl::unexpected(CannotWrite(*connection));
  }
  if (const std::int64_t format = common.Number(0, 0); format != kJournalVersion) {
    return core::Refuse(
        StatusCode::kFailedPrecondition,
        Message("the database of --database has records of version ", format,
                " but this server reads version ", std::to_string(kJournalVersion),
                "; they were left as they are: let the server that wrote them end its meshes and "
                "delete them, or choose another database"));
  }
  return std::string(common.Bytes(0, 1));
}

}  // namespace

core::Expected<std::unique_ptr<ServerLease>> ServerLease::Take(
    const std::string& url, const Options& options, const std::function<bool()>& give_up) {
  auto opened = OpenPatiently(url, options, give_up);
  if (!opened) return tl::unexpected(std::move(opened.error()));
  auto secret = JoinOthers(opened->get());
  if (!secret) return tl::unexpected(std::move(secret.error()));
  const std::atomic<bool> never{false};
  Rows entered;
  if ((*opened)->Run(kEnter, {}, &entered, never) != Outcome::kDone || entered.count() != 1) {
    return tl::unexpected(CannotWrite(**opened));
  }
  std::unique_ptr<ServerLease> lease(
      new ServerLease(url, std::move(*opened), std::move(*secret), entered.Number(0, 0)));
  if (options.alone) lease->Announce(kUnlisted);
  // The others have looked by then, and miss none of this server's meshes in their lists.
  const TimePoint seen = Clock::now() + 2 * kBetween;
  const auto must_wait = [&] {
    const std::size_t known = lease->Peers().size();  // this one among them
    return known == 0 || (known > 1 && (options.alone || Clock::now() < seen));
  };
  while (must_wait()) {
    std::this_thread::sleep_for(kBetween / 10);
    if (give_up()) return core::Refuse(StatusCode::kCancelled, "stopped while others were there");
  }
  return lease;
}

ServerLease::ServerLease(std::string url, std::unique_ptr<Connection> connection,
                         std::string secret, std::int64_t number)
    : url_(std::move(url)),
      secret_(std::move(secret)),
      connection_(std::move(connection)),
      number_(number),
      beating_([this](const std::stop_token& stop) { Run(stop); }) {}

ServerLease::~ServerLease() {
  stopping_ = true;
  beating_.request_stop();
  beating_.join();
  if (!IsAnswered()) return;
  const std::atomic<bool> never{false};
  const auto leave = [&] {
    return connection_ != nullptr && connection_->Run(kLeave, Parameters().Add(number_.load()),
                                                      nullptr, never) == Outcome::kDone;
  };
  if (leave()) return;
  if (auto opened = Connection::Open(url_)) connection_ = std::move(*opened);
  leave();
}

std::string ServerLease::address() const {
  const std::lock_guard lock(mutex_);
  return address_;
}

void ServerLease::Announce(const std::string& address) {
  const std::lock_guard lock(mutex_);
  address_ = address;
  has_news_ = true;
}

std::vector<Peer> ServerLease::Peers() const {
  std::vector<Peer> peers;
  const std::lock_guard lock(mutex_);
  for (const auto& [number, sight] : servers_)
    peers.push_back({number, sight.beats, sight.address});
  return peers;
}

void ServerLease::Renew(std::int64_t number) {
  number_ = number;
  beat_ = 0;
  lost_ = false;
}

bool ServerLease::IsAnswered() const { return Clock::now() - last_beat_.load() < kSilence; }

// What the database does not take is tried again with the next turn.
void ServerLease::Run(const std::stop_token& stop) {
  std::mutex mutex;
  std::condition_variable_any wake;
  std::unique_lock lock(mutex);
  TimePoint next_beat = Clock::now();
  do {
    if (connection_ == nullptr) {
      auto opened = Connection::Open(url_);
      if (!opened) continue;
      connection_ = std::move(*opened);
    }
    const TimePoint now = Clock::now();
    const bool is_due = (now >= next_beat || has_news_.exchange(false)) && !lost_;
    if (is_due) next_beat = now + kBeat;
    if ((is_due && !Beat()) || !Look()) {
      connection_.reset();
      const std::lock_guard servers(mutex_);
      last_look_ = {};  // silence counts while the database answers
    }
  } while (!wake.wait_for(lock, stop, kBetween, [&stop] { return stop.stop_requested(); }));
}

bool ServerLease::Beat() {
  Rows rows;
  const auto parameters = Parameters().Add(number_.load()).Add(std::string_view(address()));
  if (connection_->Run(kBeatOnce, parameters, &rows, stopping_) != Outcome::kDone) return false;
  last_beat_ = Clock::now();
  if (rows.count() == 0) {
    lost_ = true;
  } else {
    beat_ = rows.Number(0, 0);
  }
  return true;
}

bool ServerLease::Look() {
  Rows rows;
  if (connection_->Run(kLookAround, {}, &rows, stopping_) != Outcome::kDone) return false;
  const TimePoint now = Clock::now();
  const bool is_gapless = now - last_look_ < kLongestGap;
  last_look_ = now;
  std::map<std::int64_t, Sight> seen;
  bool orphans = false;
  for (int row = 0; row < rows.count(); ++row) {
    seen[rows.Number(row, 0)] = {rows.Number(row, 1), now, std::string(rows.Bytes(row, 2))};
    orphans = rows.Flag(row, 3);
  }
  {
    const std::lock_guard lock(mutex_);
    for (auto& [number, sight] : seen) {
      const auto before = servers_.find(number);
      const bool is_silent =
          is_gapless && before != servers_.end() && before->second.beats == sight.beats;
      if (is_silent) sight.since = before->second.since;
    }
    servers_ = std::move(seen);
  }
  orphans_ = orphans;
  return DeclareSilentGone(now);
}

bool ServerLease::DeclareSilentGone(TimePoint now) {
  const auto servers = servers_;  // which this thread alone changes
  for (const auto& [number, sight] : servers) {
    if (number == number_ || now - sight.since < kLease) continue;
    Rows gone;
    const auto parameters = Parameters().Add(number).Add(sight.beats);
    if (connection_->Run(kDeclareGone, parameters, &gone, stopping_) != Outcome::kDone) {
      return false;
    }
    if (gone.count() == 0) continue;
    {
      const std::lock_guard lock(mutex_);
      servers_.erase(number);
    }
    orphans_ = true;
    Log(LogLevel::kWarning, {}, "a server has fallen silent: others take up its meshes",
        LogFields().Add("server", number).Add("address", sight.address));
  }
  return true;
}

}  // namespace stellate::server
